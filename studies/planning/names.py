"""Names that become folders and files of results: on every file system, and below the folder of the results."""

from __future__ import annotations

import hashlib
import re

from studies.planning.errors import StudyError
from studies.storage.folders import IS_BACKUP, LABELS_FOLDER

MAX_BYTES = 230  # of a name: file systems allow 255, of which a backup's date and a file's suffix need some

_REFUSED = re.compile(r'[\x00-\x1f\x7f<>:"/\\|?*\ud800-\udfff]')  # by some file system, or by all
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)  # names that Windows reserves


def check_name(option: str, name: object) -> str:
    """A name that may become that of a folder.

    Parameters
    ----------
    option : str
        that sets the name, for messages
    name : object
        the value of the option

    Raises
    ------
    StudyError
        If it is not text, could be outside the folder of the results, or is refused by a file system.

    Examples
    --------
    >>> check_name("study.name", "my holes")
    'my holes'
    >>> check_name("study.name", "../holes")
    Traceback (most recent call last):
    studies.planning.errors.StudyError: study.name is '../holes': it becomes a folder, and must not contain '/'
    """
    if not isinstance(name, str):
        raise StudyError(f"{option} is {name!r}: it must be text; in quotes if it is a number: {option}=\"'{name}'\"")
    problem = _problem(name)
    if problem:
        raise StudyError(f"{option} is {name!r}: it becomes a folder, and {problem}")
    return name


def _problem(name: str) -> str:
    """Why a name cannot be that of a folder; "" if it can."""
    refused = _REFUSED.search(name)
    if refused:
        return f"must not contain {refused[0]!r}"
    if not name.strip(" ."):
        return "must have a letter or a digit"
    if name != name.strip() or name.endswith("."):
        return "must not begin or end with a space, or end with a dot"
    if _DEVICES.fullmatch(name) or name.lower() == LABELS_FOLDER or IS_BACKUP.search(name):
        return "that name is reserved"
    if len(name.encode()) > MAX_BYTES:
        return f"must not be longer than {MAX_BYTES} bytes"
    return ""


def folder_name(text: str) -> str:
    """A text as the name of a folder: with "_" for characters that some file system refuses, and not too long.

    Two texts never have the same name: one that had to be changed ends with a digest of the text.

    Examples
    --------
    >>> folder_name("segmenter.time=0.5"), folder_name("dataset.glob=a/*.off")
    ('segmenter.time=0.5', 'dataset.glob=a__.off-f06a719ad5')
    """
    name = _REFUSED.sub("_", text)
    name = name.rstrip(" .") if name.strip(" .") else "_"
    if name == text and len(name.encode()) <= MAX_BYTES:
        return name
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:10]
    shortened = name.encode()[: MAX_BYTES - len(digest) - 1].decode("utf-8", "ignore")
    return f"{shortened}-{digest}"
