"""The files of a dataset, in a folder or in a zip that stays packed."""

import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from heatwalk.meshes import MeshError
from studies.datasets.dataset import DatasetError


def folder(root: Path, inside: str) -> Path | zipfile.Path:
    """A folder of a folder or zip, either way with the same methods."""
    return root / inside if root.is_dir() else zipfile.Path(root, f"{inside}/" if inside else "")


def find(root: Path | None, holds: Callable[[Path | zipfile.Path], bool], layout: str) -> tuple[Path, str]:
    """The root, and where in it the data are: at its top, or one or two folders below.

    Parameters
    ----------
    root : the folder or zip; None where nobody said
    holds : whether the data are in this folder
    layout : what should be there, and how to say where it is: the end of every error message

    Raises
    ------
    DatasetError
        If there is no such folder, or more than one of the same depth.
    """
    if root is None:
        raise DatasetError(f"the dataset is not told where its files are.\n{layout}")
    if not root.exists():
        raise DatasetError(f"{root} does not exist.\n{layout}")
    level = [""] if root.is_dir() or zipfile.is_zipfile(root) else []
    for _ in range(3):
        found = [inside for inside in level if holds(folder(root, inside))]
        if len(found) > 1:
            raise DatasetError(f"{root} holds such data more than once, in {' and '.join(found)}.\n{layout}")
        if found:
            return root, found[0]
        level = [
            f"{inside}/{child.name}".lstrip("/")
            for inside in level
            for child in sorted(folder(root, inside).iterdir(), key=lambda child: child.name)
            if child.is_dir()
        ]
    raise DatasetError(f"{root} does not hold the data.\n{layout}")


def read(file: Path | zipfile.Path, reader: Callable[[Path], Any]) -> Any:
    """What `reader` gives for a file, also where that is a member of a zip."""
    if isinstance(file, Path):
        return reader(file)
    with tempfile.TemporaryDirectory() as unpacking:
        unpacked = Path(unpacking, file.name)
        unpacked.write_bytes(file.read_bytes())
        try:
            return reader(unpacked)
        except MeshError as error:
            raise MeshError(str(error).replace(str(unpacked), str(file))) from error
