"""Plan, run, store and show many trials of a segmenter under a perturbation."""
