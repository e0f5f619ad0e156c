"""What a method of the user's own is, for the ids of trials: its code."""

import hashlib
import json
import sys
from pathlib import Path


def digest_of_code(target):
    """SHA-256 of the Python files of the package that `target` is defined in; of its module where that is no package.

    All of the package, because a method calls its neighbours.
    """
    module = getattr(target, "__module__", None) or type(target).__module__
    top = sys.modules[module.partition(".")[0]]
    folders = [Path(folder) for folder in getattr(top, "__path__", [])]
    files = [(file.relative_to(folder), file) for folder in folders for file in folder.rglob("*.py")]
    if not files and getattr(top, "__file__", None):
        files = [(Path(top.__file__).name, Path(top.__file__))]
    digest = hashlib.sha256()
    for place, file in sorted(files):
        digest.update(json.dumps([str(place), hashlib.sha256(file.read_bytes()).hexdigest()]).encode())
    return digest.hexdigest()
