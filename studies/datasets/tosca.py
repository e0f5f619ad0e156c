"""TOSCA: animals and people in several poses each, with the vertices that are the same point of the body.

A. M. Bronstein, M. M. Bronstein, R. Kimmel, Numerical Geometry of Non-Rigid Shapes, Springer, 2008,
doi:10.1007/978-0-387-73301-2; at 5,000 vertices by J. Ren, A. Poulenard, P. Wonka, M. Ovsjanikov, Continuous and
Orientation-preserving Correspondences via Functional Maps, ACM Trans. Graph. 37 (6), 2018,
doi:10.1145/3272127.3275040.
"""

import hashlib
import io
import re
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

from heatwalk.io import LoadedMesh, read_mesh
from heatwalk.meshes import MeshError, check_arrays, describe_error, referenced
from studies.datasets.dataset import Dataset, DatasetError, Model, check_there, natural_order, wanted
from studies.datasets.folders import find, folder, read

# The files that make up a pose, the first of them under the suffix by which it is found.
SUFFIXES = {".off": (".off",), ".mat": (".mat",), ".vert": (".vert", ".tri")}

_POSE = re.compile(r"(([a-z]+)[0-9]+)(\.off|\.mat|\.vert)")

_LAYOUT = """\
TOSCA, as a folder or as its zip, holds in one folder, or in one that is one or two below it, either of
    cat0.mat, cat1.mat …                                            the original, as MATLAB structures
    cat0.vert, cat0.tri, cat1.vert, cat1.tri …                      the original, as text
    cat0.off, cat1.off …, and corres/cat0.vts, corres/cat1.vts …    the poses sampled anew, as in TOSCA_Isometric/vtx_5k
Say where it is with dataset.root=PATH, or in the environment variable TOSCA_ROOT."""


@dataclass(frozen=True)
class TOSCAModel(Model):
    """A pose of a shape; the shape is its category.

    Attributes
    ----------
    root : TOSCA's folder or zip
    data : where in it the poses are
    suffix : of the pose's file, one of `SUFFIXES`
    listed : whether the folder ``corres`` has corresponding vertices of this shape
    standard : the pose of the same shape that the correspondence of this one is held against
    """

    root: Path
    data: str
    suffix: str
    listed: bool
    standard: str

    def load(self) -> LoadedMesh:
        files = self._files()
        if self.suffix == ".off":
            return read(files[0], read_mesh)
        try:
            vertices, faces = check_arrays(*_READERS[self.suffix](*(file.read_bytes() for file in files)))
        except Exception as error:  # whatever a broken or missing file leads to
            why = error if isinstance(error, MeshError) else describe_error(error)
            raise MeshError(f"{' and '.join(map(str, files))}: {why}") from error
        used = referenced(faces, len(vertices))
        if used.all():
            return LoadedMesh(vertices, faces, ())
        note = f"dropped {np.count_nonzero(~used):,} vertices that belong to no face"
        return LoadedMesh(vertices[used], (np.cumsum(used) - 1)[faces], (note,))

    def digest(self) -> str:
        # No text file holds the byte that keeps two of them apart.
        return hashlib.sha256(b"\0".join(file.read_bytes() for file in self._files())).hexdigest()

    def correspondence(self) -> NDArray[np.int64]:
        """The vertex of this pose at each of the points that all poses of the shape have in common.

        Returns
        -------
        (p,) int64
            Entry i of two poses of one shape is the same point of the body. Where the shape has files in ``corres``,
            these give the vertices: the ones next to points of the original, so that some occur more than once and
            some not at all. Elsewhere all poses have the same faces, and all vertices are common points, in order.

        Raises
        ------
        DatasetError
            If the pose's file in ``corres`` is missing, holds something else than one vertex number (from 1) a line, or
            another number of lines than the standard pose's; or if there are no such files, and the faces are not
            those of the standard pose.
        MeshError
            If a mesh cannot be read.
        """
        mesh, standard = self.load(), replace(self, name=self.standard)
        if not self.listed:
            if self != standard and not np.array_equal(mesh.faces, standard.load().faces):
                raise DatasetError(
                    f"{self._files()[-1]} and {standard._files()[-1]} have different faces, so that their vertices do "
                    f"not correspond by number, and {self._listing().name} is not in a folder corres beside them"
                )
            return np.arange(len(mesh.vertices))
        if mesh.notes:
            raise DatasetError(f"{self._listing()} may number other vertices than those read: {'; '.join(mesh.notes)}")
        points, n_points = self._listed(), len(standard._listed())
        if len(points) != n_points:
            raise DatasetError(f"{self._listing()} has {len(points)} lines, {standard._listing()} has {n_points}")
        outside = np.flatnonzero((points < 0) | (points >= len(mesh.vertices)))
        if len(outside):
            raise DatasetError(
                f"{self._listing()}: line {outside[0] + 1} is vertex {points[outside[0]] + 1}, "
                f"not one of 1 … {len(mesh.vertices)}"
            )
        return points

    def correspondence_digest(self) -> str:
        """SHA-256, in hexadecimal, of all that determines what `correspondence` gives."""
        return hashlib.sha256(self._listing().read_bytes()).hexdigest() if self.listed else self.digest()

    def _listed(self) -> NDArray[np.int64]:
        """The vertices that the pose's file in ``corres`` lists, counted from 0."""
        file = self._listing()
        if not file.is_file():
            raise DatasetError(f"{file} is missing: the vertices of {self.name} at the points that its shape shares")
        lines = file.read_text("utf-8", errors="replace").rstrip().splitlines()
        if not lines:
            raise DatasetError(f"{file}: the file is empty")
        for number, line in enumerate(lines, start=1):
            if not re.fullmatch(r"\s*[0-9]{1,18}\s*", line):
                raise DatasetError(f"{file}: line {number} is not a vertex number (1, 2, 3 …): {line[:40]!r}")
        return np.array(lines, dtype=np.int64) - 1

    def _files(self) -> list[Path | zipfile.Path]:
        return [folder(self.root, self.data) / f"{self.name}{suffix}" for suffix in SUFFIXES[self.suffix]]

    def _listing(self) -> Path | zipfile.Path:
        return folder(self.root, self.data) / "corres" / f"{self.name}.vts"


class TOSCA(Dataset):
    """The poses that are there, shape by shape, each in the order of their numbers.

    Parameters
    ----------
    root : the folder that holds the poses, or one up to two above it, or a zip of any of these, which stays packed
    categories : only poses of these shapes, such as "cat", in capitals or not; all without
    models : only these poses, such as "cat3"; all without. Together with `categories`: those that satisfy both
    """

    name = "tosca"

    def __init__(
        self,
        root: str | Path | None,
        categories: Sequence[str] | None = None,
        models: Sequence[str] | None = None,
    ):
        self._root = Path(root).expanduser().absolute() if root else None
        self._categories = wanted("categories", categories)
        self._names = wanted("models", models)

    def models(self) -> list[Model]:
        root, data = find(self._root, lambda inside: bool(_poses(inside)), _LAYOUT)
        there = _poses(folder(root, data))
        corres = folder(root, data) / "corres"
        listings = {file.name for file in corres.iterdir()} if corres.is_dir() else set()
        models: dict[str, TOSCAModel] = {}
        shapes: dict[str, list[str]] = {}
        for name, shape, _ in there:
            shapes.setdefault(shape, []).append(name)
        for name, shape, suffix in there:
            if name in models:
                raise DatasetError(
                    f"{folder(root, data)} has {name} both as {models[name].suffix} and as {suffix}; "
                    f"keep one kind of files in a folder"
                )
            listed = [pose for pose in shapes[shape] if f"{pose}.vts" in listings]
            models[name] = TOSCAModel(name, shape, root, data, suffix, bool(listed), (listed or shapes[shape])[0])
        chosen = list(models.values())
        if self._categories is not None:
            categories = {name.lower() for name in self._categories}
            check_there("categories", categories, set(shapes), ", ".join(shapes), root)
            chosen = [model for model in chosen if model.category in categories]
        if self._names is not None:
            check_there("models", self._names, set(models), ", ".join(models), root)
            chosen = [model for model in chosen if model.name in self._names]
        if not chosen:
            raise DatasetError(
                f"{root} has {len(models)} poses, and dataset.categories and dataset.models leave none of them"
            )
        return chosen


def _poses(inside: Path | zipfile.Path) -> list[tuple[str, str, str]]:
    """Name, shape and suffix of the poses in a folder, in their order."""
    matches = (_POSE.fullmatch(file.name) for file in inside.iterdir())
    return sorted((match.groups() for match in matches if match), key=lambda pose: natural_order("".join(pose[::2])))


# Each gives vertices (n, 3) and faces (m, 3).


def _read_mat(data: bytes) -> tuple[NDArray, NDArray]:
    held = loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=False, variable_names=["surface"])
    if not {"X", "Y", "Z", "TRIV"} <= set(getattr(held.get("surface"), "_fieldnames", ())):
        raise MeshError("no MATLAB structure `surface` with X, Y, Z and TRIV")
    surface = held["surface"]
    # MATLAB keeps whole numbers as doubles, and in its files in whichever type is small.
    faces = surface.TRIV.astype(np.int64)
    if not np.array_equal(faces, surface.TRIV):
        raise MeshError("TRIV has numbers that are not whole")
    return np.column_stack([surface.X, surface.Y, surface.Z]), faces - 1


def _read_text(vertices: bytes, faces: bytes) -> tuple[NDArray, NDArray]:
    return np.loadtxt(io.BytesIO(vertices), ndmin=2), np.loadtxt(io.BytesIO(faces), np.int64, ndmin=2) - 1


_READERS = {".mat": _read_mat, ".vert": _read_text}
