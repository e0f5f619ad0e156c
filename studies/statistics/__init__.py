"""Statistics of trials: means over models and their intervals."""
