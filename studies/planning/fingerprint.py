"""What determines a trial's result, as digests that are the same on every machine and in every process."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

from studies.datasets import Model


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
