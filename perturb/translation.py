"""Translation of the whole mesh: a control that an intrinsic method must not notice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._displacement import deform
from perturb.meshes import LENGTHS, random_direction
from perturb.perturbation import Parameters, Perturbation, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Translation(Perturbation):
    """Move the mesh as a whole in a random direction.

    Parameters
    ----------
    amount : float
        The distance, in `unit`; 0 is the identity.
    unit : str
        "bounding_box_diagonal" or "mean_edge_length".

    Notes
    -----
    A control: only the rounding of the coordinates changes the surface. It grows with the distance from the origin: at
    10,000 diagonals, a coordinate has lost 4 of its 16 digits, and at 1e8 diagonals 8. ``largest_rounding`` in
    `Perturbed.applied` is the largest deviation of a vertex from an exact translation, in mean edge lengths.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> translation = perturb.Translation(amount=2)
    >>> translation.apply(box, {"direction": np.array([0.0, 0.0, 1.0])}).mesh.bounds[0].round(3).tolist()
    [-0.5, -0.5, 2.964]
    """

    amount: float = 1.0
    unit: str = "bounding_box_diagonal"

    name: ClassVar[str] = "translation"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": tuple(LENGTHS)}

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `direction` (3,), a unit vector."""
        return {"direction": random_direction(rng)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        distance = self.amount * LENGTHS[self.unit](mesh)
        displacement = np.broadcast_to(distance * parameters["direction"], mesh.vertices.shape)
        result, counterpart, facts = deform(self, mesh, displacement)
        # Far away, subtracting the displacement is exact; subtracting the vertices first would hide their rounding.
        off = np.abs(np.asarray(result.vertices) - displacement - np.asarray(mesh.vertices)).max()
        rounding = float(off / LENGTHS["mean_edge_length"](mesh))
        return self.finish(mesh, result, counterpart, largest_rounding=rounding, **facts)
