"""Any meshes in a folder."""

from __future__ import annotations

import glob
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from heatwalk.io import LoadedMesh, read_mesh
from heatwalk.io.reading import DECOMPRESSORS, READERS, files_of, split_suffix
from studies.datasets.dataset import (
    Dataset,
    DatasetError,
    Model,
    check_weld_option,
    listed_names,
    natural_order,
    require_available,
    selected_names,
    welded_digest,
)
from studies.datasets.folders import is_macos_metadata
from studies.storage.text import encodable

SUFFIXES = tuple(READERS)


@dataclass(frozen=True)
class FileModel(Model):
    """A mesh in a file.

    Parameters
    ----------
    path : Path
        absolute path of the file
    weld : None, "exact" or float
        see `heatwalk.read_mesh`
    """

    path: Path
    weld: str | float | None = None

    def load(self) -> LoadedMesh:
        """The mesh, as `heatwalk.read_mesh` reads it."""
        return read_mesh(self.path, weld=self.weld)

    def digest(self) -> str:
        """SHA-256 of the file and of those that it refers to, and of how its vertices are merged if they are."""
        with self.path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256")
        for path in files_of(self.path)[1:]:
            digest.update(path.read_bytes() if path.is_file() else b"")
        return welded_digest(digest.hexdigest(), self.weld)


class Files(Dataset):
    """The meshes in a folder and its subfolders, or those that match a pattern.

    A model is named after its path relative to the folder (with a pattern: to the part before its first wildcard),
    without the suffix. Its category is the name of the folder that contains it, "" at the top.

    Parameters
    ----------
    glob : str or None
        a folder, a file, or a pattern with ``*``, ``?``, ``[…]``, and ``**`` for any number of folders. A relative
        one starts at the current folder. Files whose suffix is not in ``SUFFIXES``, in upper or lower case and with
        that of a compression (``.off.gz``) or without, are ignored, and so are the ``._*`` files of macOS.
    name : str
        name of the dataset in the results
    weld : None, "exact" or float
        merge coincident vertices of each mesh, see `heatwalk.read_mesh`
    models : sequence of str, optional
        names of models; all by default

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> (folder / "cats").mkdir()
    >>> (folder / "cats" / "tom.off").touch()
    >>> [(model.name, model.category) for model in Files(str(folder)).models()]
    [('cats/tom', 'cats')]
    """

    def __init__(
        self,
        glob: str | None,
        name: str = "files",
        weld: str | float | None = None,
        models: Sequence[str | int] | None = None,
    ):
        check_weld_option(weld)
        self._names = selected_names("models", models)
        self._weld = weld
        self.name = name
        self._glob = glob

    def models(self) -> list[Model]:
        """The models in natural order of their paths.

        Returns
        -------
        list of FileModel

        Raises
        ------
        DatasetError
            If no file matches, two files would have the same model name, or there is no model of a name that was
            asked for.
        """
        if not self._glob:
            raise DatasetError("the dataset 'files' needs a folder or a pattern: dataset.glob='my/meshes/**/*.off'")
        top, pattern = _split(Path(self._glob).expanduser())
        found = (Path(path) for path in glob.iglob(pattern, root_dir=top, recursive=True))
        paths = sorted(
            (path for path in found if _is_mesh_name(path) and (top / path).is_file()),
            key=lambda path: natural_order(path.as_posix()),
        )
        if not paths:
            raise DatasetError(
                f"no mesh ({', '.join(SUFFIXES)}) matches dataset.glob={self._glob!r}, searched from {Path.cwd()}"
            )
        models: dict[str, FileModel] = {}
        for path in paths:
            name = encodable(path.with_name(split_suffix(path.name)[0]).as_posix())
            if name in models:
                raise DatasetError(
                    f"{models[name].path} and {top / path} would both be the model {name!r}; "
                    f"give a pattern that matches one of them, such as "
                    f"dataset.glob='{top}/**/*{split_suffix(path.name)[1]}'"
                )
            models[name] = FileModel(name, encodable(path.parent.name), (top / path).absolute(), self._weld)
        if self._names is None:
            return list(models.values())
        require_available("models", self._names, set(models), listed_names(list(models)), top)
        return [model for name, model in models.items() if name in self._names]


def _is_mesh_name(path: Path) -> bool:
    """Whether a file is a mesh by its name."""
    return bool(split_suffix(path.name)[1]) and not any(is_macos_metadata(part) for part in path.parts)


def _split(path: Path) -> tuple[Path, str]:
    """The folder that names are relative to, and the pattern below it."""
    if path.is_dir():
        return path, "**/*"
    if path.exists():
        return path.parent, glob.escape(path.name)
    parts = path.parts
    # A folder whose name looks like a pattern, such as "meshes [1]", is that folder.
    is_pattern = (glob.has_magic(part) and not Path(*parts[: i + 1]).is_dir() for i, part in enumerate(parts))
    fixed = next((i for i, magic in enumerate(is_pattern) if magic), len(parts) - 1)
    return Path(*parts[:fixed]), _any_case(str(Path(*parts[fixed:])))


def _any_case(pattern: str) -> str:
    """A pattern that matches its suffix in upper and lower case: ``*.off`` finds ``1.OFF``."""
    suffix = split_suffix(Path(pattern).name)[1]
    if not suffix and Path(pattern).suffix.lower() in DECOMPRESSORS:
        suffix = Path(pattern).suffix
    if not suffix:
        return pattern
    either = "".join(f"[{letter.lower()}{letter.upper()}]" if letter.isalpha() else letter for letter in suffix)
    return pattern.removesuffix(suffix) + either
