"""Swelling and shrinking of parts of the shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._displacement import deform
from perturb._places import draw_places
from perturb.meshes import LENGTHS
from perturb.perturbation import Parameters, Perturbation, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class LocalScale(Perturbation):
    """Scale space smoothly around a few random places: some parts swell, others shrink.

    Parameters
    ----------
    amount : float
        The strength, 0 to 1: at the centre of a place lengths are multiplied or divided by 1 + amount.
    unit : str
        "factor_minus_one".
    places : int
        How many places. Half of them shrink; of an odd number, one more swells.
    radius : float
        How far a place reaches, as a share of the bounding-box diagonal.

    Notes
    -----
    Places are random points of the surface, all parts of it being equally likely. Space is scaled about the mean of the
    vertices within the radius, so that a limb becomes thicker or thinner rather than moving aside; the change of the
    factor falls off as (1 − t²)², where t is the distance from that mean relative to the radius. Amounts of up to 1
    do not fold space. Places take effect one after another. The radius is one in space, so two parts that are near
    each other are scaled together.

    References
    ----------
    A perturbation of SHREC's robustness tracks ("local scale"), which do not say how it was drawn.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> swelling = perturb.LocalScale(amount=0.5, radius=10)  # much larger than the sphere: nearly uniform
    >>> swollen = swelling.apply(sphere, {"vertices": np.array([0]), "signs": np.array([1])})
    >>> np.linalg.norm(swollen.mesh.vertices, axis=1).mean().round(3).item()
    1.499
    """

    amount: float = 0.5
    unit: str = "factor_minus_one"
    places: int = 5
    radius: float = 0.15

    name: ClassVar[str] = "local_scale"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("factor_minus_one",)}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=1)
        self.check_number("places", positive=True, whole=True)
        self.check_number("radius", positive=True)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `vertices` (k,), the places, and `signs` (k,), 1 where the shape swells and -1 where it shrinks."""
        return {
            "vertices": draw_places(mesh, int(self.places), rng, self.name),
            "signs": rng.permutation(np.resize([1, -1], int(self.places))),
        }

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        radius = self.radius * LENGTHS["bounding_box_diagonal"](mesh)
        displacement = np.zeros(mesh.vertices.shape)
        used = np.unique(mesh.faces)
        for vertex, sign in zip(parameters["vertices"], parameters["signs"], strict=True):
            change = self.amount if sign > 0 else -self.amount / (1 + self.amount)
            displacement += _scaled_around(np.asarray(mesh.vertices) + displacement, used, vertex, radius, change)
        result, counterpart, facts = deform(self, mesh, displacement)
        return self.finish(
            mesh, result, counterpart, places_swollen=int(np.count_nonzero(parameters["signs"] > 0)), **facts
        )


def _scaled_around(vertices: np.ndarray, used: np.ndarray, place: int, radius: float, change: float) -> np.ndarray:
    """(n, 3) the displacement by a scaling that is 1 + change at the centre of a place and 1 at the radius."""
    offset = (vertices - vertices[place]) / radius
    near = used[np.linalg.norm(offset[used], axis=1) < 1]
    offset -= offset[near].mean(axis=0)
    fall_off = np.maximum(1 - np.sum(offset**2, axis=1), 0) ** 2
    return radius * change * fall_off[:, None] * offset
