"""What determines a trial's result, as digests that are the same on every machine and in every process."""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from studies.datasets import Model

if TYPE_CHECKING:
    from studies.experiments import Experiment
    from studies.planning.trial import Trial

TRIAL_ID_LENGTH = 24
_THIS_PROJECT = "studies"

AnyTrial = TypeVar("AnyTrial", bound="Trial")


def digest(*parts: Any) -> str:
    """SHA-256, in hexadecimal, of the JSON of ``parts``.

    Examples
    --------
    >>> digest("holes", 58) == digest("holes", 58), digest("holes", 58) == digest("holes", 59)
    (True, False)
    """
    return digest_of_text(json.dumps(parts, sort_keys=True))


def digest_of_text(text: str) -> str:
    """SHA-256, in hexadecimal, of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def fingerprint(model: Model) -> list[str]:
    """What determines a model: its content, and its name too, since one benchmark mesh has two numbers."""
    return [model.name, model.digest()]


def with_version(trial: AnyTrial, experiment: Experiment) -> AnyTrial:
    """A trial whose id also depends on what an experiment outside this project computes: on its version, or its code.

    Parameters
    ----------
    trial : Trial
    experiment : Experiment
        which planned it

    Returns
    -------
    Trial
        the trial itself if experiment and trial are part of this project and declare no version
    """
    version = experiment.version
    if version is None:
        own = {_top(type(each)): type(each) for each in (experiment, trial) if _top(type(each)) != _THIS_PROJECT}
        if not own:
            return trial
        version = _digest_of_packages(*own.values())
    return replace(trial, trial_id=digest(trial.trial_id, version)[:TRIAL_ID_LENGTH])


@lru_cache(maxsize=8)
def _digest_of_packages(*targets: type) -> str:
    """The digest of the code of some classes, which thousands of trials share."""
    return digest(*map(digest_of_code, targets))


def _top(target: type) -> str:
    """The package, or the module outside packages, that defines a class."""
    return target.__module__.partition(".")[0]


def digest_of_code(target: Any) -> str:
    """SHA-256 of the Python files of the package that defines ``target``, or of its module if that is not in a package.

    The whole package, because a method calls its neighbours.

    Parameters
    ----------
    target : function, class or instance
    """
    module = getattr(target, "__module__", None) or type(target).__module__
    top = sys.modules[module.partition(".")[0]]
    folders = [Path(folder) for folder in getattr(top, "__path__", [])]
    files = [(file.relative_to(folder), file) for folder in folders for file in folder.rglob("*.py")]
    if not files and getattr(top, "__file__", None):
        files = [(Path(str(top.__file__)).name, Path(str(top.__file__)))]  # type: ignore[list-item]
    total = hashlib.sha256()
    for name, file in sorted(files):
        total.update(json.dumps([str(name), hashlib.sha256(file.read_bytes()).hexdigest()]).encode())
    return total.hexdigest()
