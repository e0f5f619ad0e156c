"""Three animals whose meshes are part of installed packages, so that a study runs without any download."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import distribution, version
from pathlib import Path

import numpy as np

from heatwalk.examples import EXAMPLES
from heatwalk.io import LoadedMesh, read_mesh
from studies.datasets.cache import cached_mesh
from studies.datasets.dataset import Dataset, DatasetError, Model, selected_names


@dataclass(frozen=True)
class Recipe:
    """How a packaged mesh becomes one closed, evenly sampled surface of some 7,000 vertices.

    Parameters
    ----------
    package : str
        the distribution that contains the mesh
    file : str
        path of the mesh in it
    alpha : float
        coarseness of the alpha wrap, in percent of the bounding-box diagonal
    offset : float
        distance of the wrap from the mesh, in percent of the bounding-box diagonal
    subdivide : bool
        whether to refine and smooth the wrap by one Loop subdivision

    Notes
    -----
    An alpha wrap resamples a shape with well-shaped triangles and joins its pieces. Its result is the same to the
    byte in every process; the isotropic remeshing of pymeshlab 2025.7 returns one of two results, depending on the
    process.

    References
    ----------
    C. Portaneri, M. Rouxel-Labbé, M. Hemmer, D. Cohen-Steiner, P. Alliez, Alpha Wrapping with an Offset, ACM Trans.
    Graph. 41 (4), 2022, doi:10.1145/3528223.3530152.
    """

    package: str
    file: str
    alpha: float
    offset: float
    subdivide: bool

    @property
    def path(self) -> Path:
        """The file of the mesh."""
        return Path(str(distribution(self.package).locate_file(self.file)))


RECIPES = {
    # Fifteen closed pieces, 486 vertices in all, up to 3.6 % of the diagonal apart. At this alpha any offset from
    # 1.2 to 1.5 % joins them without handles; a closer wrap leaves pieces loose, or joins legs to form rings.
    "ant": Recipe(*EXAMPLES["ant"], alpha=1.5, offset=1.3, subdivide=True),
    # Closed and in one piece, with 28,088 vertices. (The other packaged bunny has holes.)
    "bunny": Recipe(*EXAMPLES["bunny"], alpha=0.95, offset=0.25, subdivide=False),
    # Closed and in one piece, with 2,904 vertices.
    "cow": Recipe(*EXAMPLES["cow"], alpha=0.8, offset=0.25, subdivide=False),
}


@dataclass(frozen=True)
class BundledModel(Model):
    """The model of one of `RECIPES`. The first `load` takes one to six seconds; the mesh is then kept on disk."""

    def load(self) -> LoadedMesh:
        """The wrapped mesh."""
        mesh = _loaded(self.name, self.digest())
        return LoadedMesh(mesh.vertices.copy(), mesh.faces.copy(), mesh.notes)

    def digest(self) -> str:
        """SHA-256 of the packaged mesh, the recipe and the versions of the packages that apply it."""
        recipe = RECIPES[self.name]
        how = (recipe.alpha, recipe.offset, recipe.subdivide, version("pymeshlab"), version("trimesh"))
        return hashlib.sha256(recipe.path.read_bytes() + repr(how).encode()).hexdigest()


class Bundled(Dataset):
    """The ant, the bunny and the cow.

    Parameters
    ----------
    models : sequence of str, optional
        some of these names; all by default

    Examples
    --------
    >>> [model.name for model in Bundled(["cow", "ant"]).models()]
    ['ant', 'cow']
    """

    name = "bundled"

    def __init__(self, models: Sequence[str] | None = None):
        self._names = selected_names("models", models)

    def models(self) -> list[Model]:
        """The models in alphabetical order.

        Returns
        -------
        list of BundledModel

        Raises
        ------
        DatasetError
            If there is no model of a name that was asked for.
        """
        names = set(RECIPES) if self._names is None else self._names
        if not names or names - RECIPES.keys():
            requested = ", ".join(sorted(names))
            raise DatasetError(f"dataset.models=[{requested}]: the bundled models are {', '.join(RECIPES)}")
        return [BundledModel(name, "animal") for name in RECIPES if name in names]

    def total(self) -> int:
        """Three."""
        return len(RECIPES)


@lru_cache
def _loaded(name: str, digest: str) -> LoadedMesh:
    """The mesh of a recipe, computed or read once per process."""
    return cached_mesh(digest, lambda: prepare(RECIPES[name]))


def prepare(recipe: Recipe) -> LoadedMesh:
    """Compute the mesh of a recipe.

    Parameters
    ----------
    recipe : Recipe

    Returns
    -------
    LoadedMesh
        the wrap; its last note describes the resampling
    """
    import pymeshlab  # half a second, which a mesh that is on disk already does not need

    packaged = read_mesh(recipe.path)
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(packaged.vertices, packaged.faces))
    meshes.generate_alpha_wrap(
        alpha=pymeshlab.PercentageValue(recipe.alpha), offset=pymeshlab.PercentageValue(recipe.offset)
    )
    wrap = meshes.current_mesh()
    vertices, faces = wrap.vertex_matrix(), wrap.face_matrix().astype(np.int64)
    if recipe.subdivide:
        import trimesh

        vertices, faces = trimesh.remesh.subdivide_loop(vertices, faces, iterations=1)
    note = (
        f"resampled by an alpha wrap {recipe.offset} % of the diagonal away"
        f"{' and a Loop subdivision' if recipe.subdivide else ''}: "
        f"{len(packaged.vertices):,} vertices became {len(vertices):,}"
    )
    return LoadedMesh(vertices, faces, (*packaged.notes, note))
