"""What a perturbation is, what it gives, and the registry of names."""

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from typing import Any, ClassVar

import numpy as np
import trimesh
from scipy.sparse import coo_array

from heatwalk.laplacian import vertex_components
from heatwalk.numerics.triangles import areas

Parameters = dict[str, Any]  # what `sample` drew: arrays and numbers that `apply` turns into a mesh

LENGTHS: dict[str, Callable[[trimesh.Trimesh], float]] = {
    "mean_edge_length": lambda mesh: float(mesh.edges_unique_length.mean()),
    "bounding_box_diagonal": lambda mesh: float(np.linalg.norm(mesh.extents)),
}
"""Name of a unit -> its length on a mesh, in the mesh's own units."""

_REGISTRY: dict[str, type["Perturbation"]] = {}


class PerturbationError(ValueError):
    """A perturbation that cannot be built, cannot be applied to this mesh, or leaves nothing usable of it."""


@dataclass(frozen=True)
class Perturbed:
    """A perturbed mesh, and how it hangs together with the original.

    mesh : trimesh.Trimesh, built with process=False.
    counterpart : (n_original,) int64, for each original vertex its counterpart in `mesh`, -1 if it is gone.
    applied : what was really done; plain Python scalars, strings and None only, so it can be written as JSON.
    """

    mesh: trimesh.Trimesh
    counterpart: np.ndarray
    applied: dict[str, str | int | float | bool | None]


@dataclass(frozen=True)
class Perturbation(ABC):
    """A way to spoil a mesh: a function (mesh, rng) -> Perturbed that leaves its input as it is.

    Drawing the random parameters (`sample`) and using them (`apply`) are apart: parameters that were drawn
    once can be applied again, and give the same result.

    amount : how much, in `unit`; at `neutral` the perturbation is the identity.
    unit : what `amount` counts, one of `choices["unit"]`.

    Raises PerturbationError (a ValueError) for a field that is out of range, when it is built; and for an
    amount that this mesh does not allow, an unusable input or an unusable result, when it is called.
    """

    amount: float
    unit: str

    name: ClassVar[str]
    version: ClassVar[int] = 1  # raised where a seed gives another result, so that stored ones are not taken for it
    neutral: ClassVar[float] = 0.0
    choices: ClassVar[dict[str, tuple[str, ...]]]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        _REGISTRY[cls.name] = cls

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.generic):  # `applied` holds plain Python scalars
                object.__setattr__(self, field.name, value.item())
        for field_name, valid in self.choices.items():
            value = getattr(self, field_name)
            if value not in valid:
                raise PerturbationError(f"{self.name}: {field_name} is {value!r}; choose one of {', '.join(valid)}")
        self._check_number("amount")

    def __call__(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Perturbed:
        """Draw parameters from `rng` and apply them to `mesh`, which is not changed."""
        _check_usable(mesh, f"{self.name}: the mesh handed in")
        return self.apply(mesh, self.sample(mesh, rng))

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw the random parameters; empty for a perturbation that leaves nothing to chance."""
        return {}

    @abstractmethod
    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        """Perturb `mesh` with parameters that `sample` drew for it."""

    def _check_number(self, field: str, *, most: float = math.inf, positive: bool = False, whole: bool = False) -> None:
        """Raise PerturbationError unless the field is a finite number, 0 <= number <= most."""
        value = getattr(self, field)
        if not isinstance(value, Real) or not math.isfinite(value) or value < 0 or value > most:
            upper = "" if math.isinf(most) else f" and at most {most:g}"
            raise PerturbationError(f"{self.name}: {field} is {value!r}; it must be a number of at least 0{upper}")
        if positive and value == 0:
            raise PerturbationError(f"{self.name}: {field} is {value!r}; it must be above 0")
        if whole and value != int(value):
            raise PerturbationError(f"{self.name}: {field} is {value!r}; it must be a whole number")

    def _finish(
        self, original: trimesh.Trimesh, mesh: trimesh.Trimesh, counterpart: np.ndarray, **facts: Any
    ) -> Perturbed:
        """Check the result and say in `applied` what was asked for, what changed, and the given facts."""
        _check_usable(mesh, f"{self.name}, {self.amount:g} {self.unit}: the result")
        applied = {
            "name": self.name,
            **dataclasses.asdict(self),
            **facts,
            "vertices_before": len(original.vertices),
            "vertices_after": len(mesh.vertices),
            "faces_before": len(original.faces),
            "faces_after": len(mesh.faces),
            "components_before": _component_count(original),
            "components_after": _component_count(mesh),
        }
        return Perturbed(mesh, counterpart.astype(np.int64, copy=False), applied)


def names() -> list[str]:
    """Names of all registered perturbations, sorted."""
    return sorted(_REGISTRY)


def get(name: str) -> type[Perturbation]:
    """The perturbation of that name; PerturbationError, with the names there are, if there is none."""
    if name not in _REGISTRY:
        raise PerturbationError(f"no perturbation is called {name!r}; there are {', '.join(names())}")
    return _REGISTRY[name]


def moved(mesh: trimesh.Trimesh, displacement: np.ndarray) -> tuple[trimesh.Trimesh, np.ndarray]:
    """The mesh with its vertices displaced by (n, 3) vectors, and the counterpart of every vertex: itself."""
    vertices = np.asarray(mesh.vertices) + displacement
    return trimesh.Trimesh(vertices, mesh.faces.copy(), process=False), np.arange(len(vertices))


def without_faces(mesh: trimesh.Trimesh, dropped: np.ndarray) -> tuple[trimesh.Trimesh, np.ndarray]:
    """The mesh without the faces marked in `dropped` (m,) bool, and (n,) the counterpart of every vertex.

    A vertex that loses its last face goes too. One that had none before stays: cleaning is not perturbing.
    """
    faces = np.asarray(mesh.faces)
    lost = np.zeros(len(mesh.vertices), dtype=bool)
    lost[faces[dropped]] = True
    lost[faces[~dropped]] = False
    counterpart = np.where(lost, -1, np.cumsum(~lost) - 1)
    rest = trimesh.Trimesh(np.asarray(mesh.vertices)[~lost], counterpart[faces[~dropped]], process=False)
    return rest, counterpart


def edge_graph(mesh: trimesh.Trimesh) -> coo_array:
    """(n, n) symmetric matrix of edge lengths; distances along edges overestimate those on the surface."""
    n = len(mesh.vertices)
    start, end = mesh.edges_unique.T
    length = np.tile(mesh.edges_unique_length, 2)
    return coo_array((length, (np.r_[start, end], np.r_[end, start])), shape=(n, n))


def _component_count(mesh: trimesh.Trimesh) -> int:
    """Connected components, through shared vertices; vertices without faces are not counted."""
    faces = np.asarray(mesh.faces)
    return int(np.count_nonzero(np.bincount(vertex_components(len(mesh.vertices), faces)[faces[:, 0]])))


def _check_usable(mesh: trimesh.Trimesh, what: str) -> None:
    """Raise PerturbationError for a mesh that nothing can be done with."""
    counts = f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces"
    if len(mesh.faces) == 0:
        raise PerturbationError(f"{what} has no face ({counts})")
    if len(mesh.vertices) < 4:
        raise PerturbationError(f"{what} has fewer than 4 vertices ({counts})")
    if not np.isfinite(mesh.vertices).all():
        raise PerturbationError(f"{what} has coordinates that are not finite ({counts})")
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    size = max(np.ptp(coordinate[faces]) for coordinate in vertices.T)
    # Relative to the size: an area of 1e-60 is not degenerate on a mesh of 1e-30.
    if size == 0 or areas(vertices / size, faces).max() < np.finfo(float).eps:
        raise PerturbationError(f"{what} has only degenerate triangles ({counts})")
