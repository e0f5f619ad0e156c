"""The leaderboard: every method under every perturbation, and who is robust, under what, and by how much."""

from studies.experiments.leaderboard.experiment import Leaderboard

__all__ = ["Leaderboard"]
