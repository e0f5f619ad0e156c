"""The files of a dataset, in a folder or in a zip archive that stays packed."""

from __future__ import annotations

import os
import tempfile
import zipfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from heatwalk.meshes import MeshError
from studies.datasets.dataset import DatasetError

Content = TypeVar("Content")


def folder(root: Path, inside: str) -> Path | zipfile.Path:
    """A folder inside a folder or archive; both have the same methods.

    Parameters
    ----------
    root : Path
        a folder or a zip archive
    inside : str
        path inside it, with "/" between its parts; "" for its top

    Returns
    -------
    Path or zipfile.Path
    """
    if root.is_dir():
        return root / inside
    status = root.stat()
    archive = _archive(root, status.st_mtime_ns, status.st_size, os.getpid())
    return zipfile.Path(archive.root, f"{inside}/" if inside else "")


@lru_cache(maxsize=4)
def _archive(root: Path, modified: int, size: int, process: int) -> zipfile.Path:
    """An archive that is open: finding its thousands of members takes longer than reading one.

    The other arguments tell whether it has been replaced; and a process that was forked must not share the position in
    the file with its parent.
    """
    return zipfile.Path(root)


def find(root: Path | None, contains_data: Callable[[Path | zipfile.Path], bool], layout: str) -> tuple[Path, str]:
    """Find the data at the top of a folder or archive, or up to two levels below.

    Parameters
    ----------
    root : Path or None
        a folder or a zip archive; None if the option is not set
    contains_data : callable
        whether a folder contains the data
    layout : str
        description of the expected files and of the option that locates them: the end of every error message

    Returns
    -------
    root : Path
    inside : str
        path of the data inside it, as `folder` takes it

    Raises
    ------
    DatasetError
        If no folder contains the data, or more than one at the same level does.
    """
    if root is None:
        raise DatasetError(f"the location of the dataset is not set.\n{layout}")
    if not root.exists():
        raise DatasetError(f"{root} does not exist.\n{layout}")
    level = [""] if root.is_dir() or zipfile.is_zipfile(root) else []
    for _ in range(3):
        found = [inside for inside in level if contains_data(folder(root, inside))]
        if len(found) > 1:
            raise DatasetError(f"{root} contains the data more than once, in {' and '.join(found)}.\n{layout}")
        if found:
            return root, found[0]
        level = [f"{inside}/{name}".lstrip("/") for inside in level for name in _subfolders(folder(root, inside))]
    raise DatasetError(f"{root} does not contain the data.\n{layout}")


def _subfolders(parent: Path | zipfile.Path) -> list[str]:
    """The names of the folders in a folder, sorted."""
    return sorted(child.name for child in parent.iterdir() if child.is_dir() and not is_macos_metadata(child.name))


def is_macos_metadata(name: str) -> bool:
    """Whether a file or folder is one that macOS adds to foreign disks and archives: ``._1.off``, ``__MACOSX``."""
    return name.startswith("._") or name == "__MACOSX"


def read(file: Path | zipfile.Path, reader: Callable[[Path], Content]) -> Content:
    """Apply a reader to a file, which may be a member of an archive.

    Parameters
    ----------
    file : Path or zipfile.Path
        the file
    reader : callable
        reads a file of the file system

    Returns
    -------
    object
        the result of ``reader``

    Raises
    ------
    heatwalk.MeshError
        If ``reader`` does; the message names the file in the archive.
    """
    if isinstance(file, Path):
        return reader(file)
    with tempfile.TemporaryDirectory() as unpacking:
        unpacked = Path(unpacking, file.name)
        unpacked.write_bytes(file.read_bytes())
        try:
            return reader(unpacked)
        except MeshError as error:
            raise MeshError(str(error).replace(str(unpacked), str(file))) from error
