"""Rotation of the whole mesh: a control that an intrinsic method must not notice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._displacement import deform
from perturb.meshes import random_direction
from perturb.perturbation import Parameters, Perturbation, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Rotation(Perturbation):
    """Rotate the mesh about a random axis through the centre of its bounding box.

    Parameters
    ----------
    amount : float
        The angle in degrees, 0 to 180, clockwise or anticlockwise with equal probability; 0 is the identity.
    unit : str
        "degrees".

    Notes
    -----
    A control: nothing about the surface changes except the rounding of its coordinates, so a method that measures
    along the surface must return the same labels.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> box = trimesh.creation.box(extents=[1, 2, 4])
    >>> turned = perturb.Rotation(amount=90).apply(box, {"axis": np.array([1.0, 0.0, 0.0])})
    >>> turned.mesh.extents.round(9).tolist()
    [1.0, 4.0, 2.0]
    """

    amount: float = 90.0
    unit: str = "degrees"

    name: ClassVar[str] = "rotation"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("degrees",)}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=180)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `axis` (3,), a unit vector."""
        return {"axis": random_direction(rng)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        axis, angle = parameters["axis"], np.radians(self.amount)
        offset = np.asarray(mesh.vertices) - mesh.bounds.mean(axis=0)
        across = np.cross(axis, offset)
        # Rodrigues' formula without the identity, so that an angle of 0 moves nothing.
        displacement = np.sin(angle) * across + (1 - np.cos(angle)) * np.cross(axis, across)
        result, counterpart, facts = deform(self, mesh, displacement)
        return self.finish(mesh, result, counterpart, **facts)
