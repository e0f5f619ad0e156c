"""TOSCA: animals and people in several poses each, with the vertices that are the same point of the body.

A. M. Bronstein, M. M. Bronstein, R. Kimmel, Numerical Geometry of Non-Rigid Shapes, Springer, 2008,
doi:10.1007/978-0-387-73301-2; at 5,000 vertices by J. Ren, A. Poulenard, P. Wonka, M. Ovsjanikov, Continuous and
Orientation-preserving Correspondences via Functional Maps, ACM Trans. Graph. 37 (6), 2018,
doi:10.1145/3272127.3275040.
"""

from __future__ import annotations

import hashlib
import io
import re
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heatwalk.io import LoadedMesh, parse_integers, read_mesh
from heatwalk.io.reading import split_suffix
from heatwalk.meshes import MeshError, check_arrays, describe_error, drop_unreferenced
from studies.datasets.dataset import Dataset, DatasetError, Model, natural_order, require_available, selected_names
from studies.datasets.folders import find, folder, read
from studies.reporting.text import count_of

# The files that make up a pose of the original, by the suffix of the file that identifies it. A remeshed pose is one
# file in a format that `heatwalk.read_mesh` reads.
SUFFIXES = {".mat": (".mat",), ".vert": (".vert", ".tri")}

_POSE = re.compile(r"([a-z]+)[0-9]+")

_LAYOUT = """\
TOSCA, a folder or a zip archive, contains at its top, or in a folder one or two levels below, one of
    cat0.mat, cat1.mat …                                            the original, as MATLAB structures
    cat0.vert, cat0.tri, cat1.vert, cat1.tri …                      the original, as text
    cat0.off, cat1.off …, and corres/cat0.vts, corres/cat1.vts …    the remeshed poses, as in TOSCA_Isometric/vtx_5k
Set its location by dataset.root=PATH, or by the environment variable TOSCA_ROOT."""


@dataclass(frozen=True)
class TOSCAModel(Model):
    """A pose of a shape; the shape is its category.

    Parameters
    ----------
    root : Path
        folder or zip archive of TOSCA
    data : str
        path in it of the folder that contains the poses
    suffix : str
        suffix of the pose's file, in lower case: one of `SUFFIXES`, or of those that `heatwalk.read_mesh` reads
    listed : bool
        whether the folder ``corres`` contains lists of corresponding vertices of this shape
    standard : str
        name of the pose of the same shape that the correspondence of this one is checked against
    """

    root: Path
    data: str
    suffix: str
    listed: bool
    standard: str

    def load(self) -> LoadedMesh:
        """The mesh of the pose, without vertices that belong to no face."""
        files = self._files()
        if self.suffix not in _READERS:
            return read(files[0], read_mesh)
        try:
            vertices, faces = check_arrays(*_READERS[self.suffix](*(file.read_bytes() for file in files)))
        except Exception as error:  # whatever a broken or missing file leads to
            why = error if isinstance(error, MeshError) else describe_error(error)
            raise MeshError(f"{' and '.join(map(str, files))}: {why}") from error
        n_vertices = len(vertices)
        vertices, faces, kept = drop_unreferenced(vertices, faces)
        n_dropped = n_vertices - len(kept)
        notes = (f"dropped {n_dropped:,} vertices that belong to no face",) if n_dropped else ()
        return LoadedMesh(vertices, faces, notes)

    def digest(self) -> str:
        """SHA-256 of the pose's files."""
        # The zero byte that separates two text files does not occur in them.
        return hashlib.sha256(b"\0".join(file.read_bytes() for file in self._files())).hexdigest()

    def correspondence(self) -> NDArray[np.int64]:
        """The vertices of this pose at the points that all poses of the shape have in common.

        Returns
        -------
        (p,) int64 array
            Entry i of two poses of one shape is the same point of the body. If the shape has files in ``corres``,
            they list the vertices: those next to points of the original, so that some occur more than once and
            some not at all. Otherwise all poses have the same faces, and all vertices are common points, in order.

        Raises
        ------
        DatasetError
            If the pose's file in ``corres`` is missing, contains anything else than one vertex number (from 1) per
            line, or has another number of lines than that of the standard pose; or if there are no such files and the
            faces differ from those of the standard pose.
        MeshError
            If a mesh cannot be read.
        """
        mesh = self.load()
        if not self.listed:
            self._require_standard_faces(mesh)
            return np.arange(len(mesh.vertices))
        dropped = [note for note in mesh.notes if note.startswith("dropped")]
        if dropped:
            raise DatasetError(f"{self._list_file()} may number other vertices than those read: {'; '.join(dropped)}")
        points, standard = self._listed_vertices(), self._standard_pose()
        n_points = len(standard._listed_vertices())
        if len(points) != n_points:
            raise DatasetError(f"{self._list_file()} has {len(points)} lines, {standard._list_file()} has {n_points}")
        outside = np.flatnonzero((points < 0) | (points >= len(mesh.vertices)))
        if len(outside):
            raise DatasetError(
                f"{self._list_file()}: line {outside[0] + 1} is vertex {points[outside[0]] + 1}, "
                f"not one of 1 … {len(mesh.vertices)}"
            )
        return points

    def correspondence_digest(self) -> str:
        """SHA-256 of all that determines the result of `correspondence`."""
        return hashlib.sha256(self._list_file().read_bytes()).hexdigest() if self.listed else self.digest()

    def _standard_pose(self) -> TOSCAModel:
        """The pose that correspondences are checked against."""
        return replace(self, name=self.standard)

    def _require_standard_faces(self, mesh: LoadedMesh) -> None:
        """Raise if the faces differ from those of the standard pose."""
        standard = self._standard_pose()
        if self != standard and not np.array_equal(mesh.faces, standard.load().faces):
            raise DatasetError(
                f"{self._files()[-1]} and {standard._files()[-1]} have different faces, so that their vertices do not "
                f"correspond by number, and {self._list_file().name} is not in a folder corres next to them"
            )

    def _listed_vertices(self) -> NDArray[np.int64]:
        """The vertices that the pose's file in ``corres`` lists, counted from 0."""
        file = self._list_file()
        if not file.is_file():
            raise DatasetError(f"{file} is missing: it lists the vertices of {self.name} at the points of its shape")
        return _read_vertex_numbers(file) - 1

    def _files(self) -> list[Path | zipfile.Path]:
        """The files of the pose."""
        inside = folder(self.root, self.data)
        return [_file(inside, self.name, suffix) for suffix in SUFFIXES.get(self.suffix, (self.suffix,))]

    def _list_file(self) -> Path | zipfile.Path:
        """The pose's file in ``corres``."""
        return _file(folder(self.root, self.data) / "corres", self.name, ".vts")


class TOSCA(Dataset):
    """The available poses, shape by shape, each in the order of their numbers.

    Parameters
    ----------
    root : str, Path or None
        the folder that contains the poses, or one up to two levels above, or a zip archive of any of these, which
        stays packed
    categories : sequence of str, optional
        only poses of these shapes, such as "cat", in upper or lower case; all by default
    models : sequence of str, optional
        only these poses, such as "cat3"; all by default. With ``categories``: poses that satisfy both

    Examples
    --------
    >>> import tempfile
    >>> poses = Path(tempfile.mkdtemp())
    >>> for name in ("cat10", "cat2", "dog0"):
    ...     (poses / f"{name}.off").touch()
    >>> [(model.name, model.category) for model in TOSCA(poses).models()]
    [('cat2', 'cat'), ('cat10', 'cat'), ('dog0', 'dog')]
    """

    name = "tosca"

    def __init__(
        self,
        root: str | Path | None,
        categories: Sequence[str] | None = None,
        models: Sequence[str] | None = None,
    ):
        self._root = Path(root).expanduser().absolute() if root else None
        self._categories = selected_names("categories", categories)
        self._names = selected_names("models", models)

    def models(self) -> list[Model]:
        """The poses in natural order of their names.

        Returns
        -------
        list of TOSCAModel

        Raises
        ------
        DatasetError
            If TOSCA is not available, if it does not have a shape or pose that was asked for, if the two options
            together leave no pose, or if a pose is stored in two formats.
        """
        root, data = find(self._root, lambda inside: bool(_poses(inside)), _LAYOUT)
        models = _all_models(root, data)
        shapes = list(dict.fromkeys(model.category for model in models.values()))
        selected: list[Model] = list(models.values())
        if self._categories is not None:
            categories = {name.lower() for name in self._categories}
            require_available("categories", categories, set(shapes), ", ".join(shapes), root)
            selected = [model for model in selected if model.category in categories]
        if self._names is not None:
            require_available("models", self._names, set(models), ", ".join(models), root)
            selected = [model for model in selected if model.name in self._names]
        if not selected:
            raise DatasetError(
                f"{root} has {count_of(len(models), 'pose')}, and dataset.categories and dataset.models select none of "
                "them"
            )
        return selected


def _all_models(root: Path, data: str) -> dict[str, TOSCAModel]:
    """Every pose in a folder, by name."""
    poses = _poses(folder(root, data))
    corres = folder(root, data) / "corres"
    list_files = {_lower_suffix(file.name) for file in corres.iterdir()} if corres.is_dir() else set()
    shapes: dict[str, list[str]] = {}
    for name, shape, _ in poses:
        shapes.setdefault(shape, []).append(name)
    models: dict[str, TOSCAModel] = {}
    for name, shape, suffix in poses:
        if name in models:
            raise DatasetError(
                f"{folder(root, data)} has {name} both as {models[name].suffix} and as {suffix}; "
                f"keep one format per folder"
            )
        listed = [pose for pose in shapes[shape] if f"{pose}.vts" in list_files]
        models[name] = TOSCAModel(name, shape, root, data, suffix, bool(listed), (listed or shapes[shape])[0])
    return models


def _poses(inside: Path | zipfile.Path) -> list[tuple[str, str, str]]:
    """Name, shape and suffix of the poses in a folder, in natural order."""
    poses = []
    for file in inside.iterdir():
        name, suffix = _split(file.name)
        match = _POSE.fullmatch(name)
        if match and suffix:
            poses.append((name, match[1], suffix.lower()))
    return sorted(poses, key=lambda pose: natural_order(pose[0] + pose[2]))


def _split(name: str) -> tuple[str, str]:
    """The name of a pose, and the suffix of its file; "" for any other file."""
    path = Path(name)
    return (path.stem, path.suffix) if path.suffix.lower() in SUFFIXES else split_suffix(name)


def _lower_suffix(name: str) -> str:
    """The name of a file with its suffix in lower case."""
    path = Path(name)
    return path.stem + path.suffix.lower()


def _file(inside: Path | zipfile.Path, name: str, suffix: str) -> Path | zipfile.Path:
    """The file of a name and a suffix, which may be in upper case."""
    file = inside / f"{name}{suffix}"
    if file.exists() or not inside.is_dir():
        return file
    others = (other for other in inside.iterdir() if other.name.startswith(name))
    return next((other for other in others if other.name[len(name) :].lower() == suffix), file)


def _read_vertex_numbers(file: Path | zipfile.Path) -> NDArray[np.int64]:
    """The numbers in a text file that has one per line."""
    text = file.read_text("utf-8", errors="replace")
    if not text.strip():
        raise DatasetError(f"{file}: the file is empty")
    try:
        return parse_integers(text, "a vertex number (1, 2, 3 …)")
    except ValueError as error:
        raise DatasetError(f"{file}: {error}") from error


# Each reader returns vertices (n, 3) and faces (m, 3).


def _read_mat(data: bytes) -> tuple[NDArray, NDArray]:
    """The mesh of a MATLAB file with the structure ``surface``."""
    from scipy.io import loadmat  # here, because other formats do without

    stream: Any = io.BytesIO(data)
    content = loadmat(stream, squeeze_me=True, struct_as_record=False, variable_names=["surface"])
    if not {"X", "Y", "Z", "TRIV"} <= set(getattr(content.get("surface"), "_fieldnames", ())):
        raise MeshError("no MATLAB structure `surface` with X, Y, Z and TRIV")
    surface = content["surface"]
    # MATLAB represents integers as doubles, and stores them in files as the smallest type that can hold them.
    faces = surface.TRIV.astype(np.int64)
    if not np.array_equal(faces, surface.TRIV):
        raise MeshError("TRIV contains numbers that are not integers")
    return np.column_stack([surface.X, surface.Y, surface.Z]), faces - 1


def _read_text(vertices: bytes, faces: bytes) -> tuple[NDArray, NDArray]:
    """The mesh of a .vert and a .tri file."""
    return np.loadtxt(io.BytesIO(vertices), ndmin=2), np.loadtxt(io.BytesIO(faces), np.int64, ndmin=2) - 1


_READERS: dict[str, Callable[..., tuple[NDArray, NDArray]]] = {".mat": _read_mat, ".vert": _read_text}
