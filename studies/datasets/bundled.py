"""Three animals that ship inside the installed packages, so that a study runs with nothing to download."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import distribution, version
from pathlib import Path

import numpy as np
import pymeshlab
import trimesh

from heatwalk.io import LoadedMesh, read_mesh
from studies.datasets.dataset import Dataset, DatasetError, Model, wanted


@dataclass(frozen=True)
class Recipe:
    """How a mesh as it ships becomes one closed, evenly sampled surface of some 7,000 vertices.

    An alpha wrap (Portaneri et al., Alpha Wrapping with an Offset, ACM TOG 41, 2022) samples a shape anew with
    well-shaped triangles, and joins its pieces. It gives the same bytes in every process; the isotropic
    remeshing of pymeshlab 2025.7 gives one of two results, by the process.

    Attributes
    ----------
    package, file : the package that holds the mesh, and where in it
    alpha, offset : the wrap's coarseness and distance from the mesh, in percent of the bounding-box diagonal
    subdivide : whether to refine and round off the wrap by one Loop subdivision
    """

    package: str
    file: str
    alpha: float
    offset: float
    subdivide: bool

    @property
    def path(self) -> Path:
        return Path(distribution(self.package).locate_file(self.file))


_SAMPLES = "pymeshlab/tests/sample_meshes"
RECIPES = {
    # Fifteen closed pieces of 486 vertices, up to 3.6 % of the diagonal apart. At this alpha any offset from
    # 1.2 to 1.5 % joins them without handles; a nearer wrap leaves pieces loose, or joins legs in rings.
    "ant": Recipe("pyvista", "pyvista/examples/ant.ply", alpha=1.5, offset=1.3, subdivide=True),
    # Closed and in one piece, of 28,088 vertices. (The other bunny that ships has holes.)
    "bunny": Recipe("pymeshlab", f"{_SAMPLES}/bunny.obj", alpha=0.95, offset=0.25, subdivide=False),
    # Closed and in one piece, of 2,904 vertices.
    "cow": Recipe("pymeshlab", f"{_SAMPLES}/cow.obj", alpha=0.8, offset=0.25, subdivide=False),
}


@dataclass(frozen=True)
class BundledModel(Model):
    """One of `RECIPES`. The first `load` in a process takes one to six seconds, the next ones none."""

    def load(self) -> LoadedMesh:
        mesh = _prepare(self.name)
        return LoadedMesh(mesh.vertices.copy(), mesh.faces.copy(), mesh.notes)

    def digest(self) -> str:
        recipe = RECIPES[self.name]
        how = (recipe.alpha, recipe.offset, recipe.subdivide, version("pymeshlab"), version("trimesh"))
        return hashlib.sha256(recipe.path.read_bytes() + repr(how).encode()).hexdigest()


class Bundled(Dataset):
    """The ant, the bunny and the cow.

    Parameters
    ----------
    models : some of these names; all without
    """

    name = "bundled"

    def __init__(self, models: Sequence[str] | None = None):
        self._names = wanted("models", models)

    def models(self) -> list[Model]:
        names = set(RECIPES) if self._names is None else self._names
        if not names or names - RECIPES.keys():
            asked = ", ".join(sorted(names))
            raise DatasetError(f"dataset.models=[{asked}]: the bundled models are {', '.join(RECIPES)}")
        return [BundledModel(name, "animal") for name in RECIPES if name in names]


@lru_cache
def _prepare(name: str) -> LoadedMesh:
    recipe = RECIPES[name]
    shipped = read_mesh(recipe.path)
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(shipped.vertices, shipped.faces))
    meshes.generate_alpha_wrap(
        alpha=pymeshlab.PercentageValue(recipe.alpha), offset=pymeshlab.PercentageValue(recipe.offset)
    )
    wrap = meshes.current_mesh()
    vertices, faces = wrap.vertex_matrix(), wrap.face_matrix().astype(np.int64)
    if recipe.subdivide:
        vertices, faces = trimesh.remesh.subdivide_loop(vertices, faces, iterations=1)
    note = (
        f"sampled anew by an alpha wrap {recipe.offset} % of the diagonal away"
        f"{' and a Loop subdivision' if recipe.subdivide else ''}: "
        f"{len(shipped.vertices):,} vertices became {len(vertices):,}"
    )
    return LoadedMesh(vertices, faces, (*shipped.notes, note))
