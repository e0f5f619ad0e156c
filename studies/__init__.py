"""Robustness studies of mesh segmentation: plan, run, store and show many trials under perturbations.

Examples
--------
>>> import studies
>>> results = studies.run("shot_noise", ["dataset.models=[cow]", "results_dir=mine"])  # doctest: +SKIP
>>> results.tables["table"], results.rows, results.folder  # doctest: +SKIP
"""

from studies._own_packages import prefer_own_packages

prefer_own_packages()

from studies.api import load, rank, run  # noqa: E402

__all__ = ["load", "rank", "run"]
