"""Robustness studies of mesh segmentation: plan, run, store and show many trials under perturbations.

Examples
--------
>>> import studies
>>> results = studies.run("shot_noise", ["dataset.models=[cow]", "results_dir=mine"])  # doctest: +SKIP
>>> results.tables["table"], results.rows, results.folder  # doctest: +SKIP
"""

import importlib.util
import sys
from pathlib import Path

from studies.api import load, run

__all__ = ["load", "run"]


def _import_conf() -> None:
    """Import the package ``conf`` of this project, which a folder of that name in the current folder would hide."""
    path = Path(__file__).parents[1] / "conf" / "__init__.py"
    if getattr(sys.modules.get("conf"), "__file__", None) or not path.exists():
        return
    spec = importlib.util.spec_from_file_location("conf", path, submodule_search_locations=[str(path.parent)])
    if spec is not None and spec.loader is not None:
        sys.modules["conf"] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules["conf"])


_import_conf()
