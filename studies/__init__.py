"""Robustness studies of mesh segmentation: plan, run, store and show many trials under perturbations.

Examples
--------
>>> import studies
>>> results = studies.run("shot_noise", ["dataset.models=[cow]", "results_dir=mine"])  # doctest: +SKIP
>>> results.tables["table"], results.rows, results.folder  # doctest: +SKIP
"""

from studies.api import load, run

__all__ = ["load", "run"]
