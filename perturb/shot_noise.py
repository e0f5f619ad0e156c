"""Spikes: a few vertices displaced far along their normals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._displacement import displace
from perturb.meshes import LENGTHS, vertex_normals
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class ShotNoise(Perturbation):
    """Turn some vertices into spikes by moving them a fixed distance along or against their angle-weighted normal.

    Parameters
    ----------
    amount : float
        The share of vertices that become spikes, 0 to 1; ``round(amount * n)`` of them do.
    unit : str
        "share_of_vertices".
    height : float
        The distance that a spike moves, in `height_unit`.
    height_unit : str
        "mean_edge_length" (how Table 2 is read here) or "bounding_box_diagonal" (Figure 10, where the share is fixed
        and the height varies).

    Notes
    -----
    Normals are those of `perturb.vertex_normals`; vertices without one do not become spikes, and `Perturbed.applied`
    counts them, with the largest displacement and, over the spikes, the root mean square, in the mesh's own unit.

    References
    ----------
    Paper, section 6.4.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> perturbed = perturb.ShotNoise(amount=0.5)(sphere, np.random.default_rng(0))
    >>> int((perturbed.mesh.vertices != sphere.vertices).any(axis=1).sum()), len(sphere.vertices)
    (321, 642)
    """

    amount: float = 0.06
    unit: str = "share_of_vertices"
    height: float = 1.0
    height_unit: str = "mean_edge_length"

    name: ClassVar[str] = "shot_noise"
    version: ClassVar[int] = 2
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("share_of_vertices",), "height_unit": tuple(LENGTHS)}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=1)
        self.check_number("height")

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `vertices` (k,), the spikes, and `signs` (k,), 1.0 for outwards and -1.0 for inwards."""
        count = round(self.amount * len(mesh.vertices))
        movable = np.flatnonzero(vertex_normals(mesh).any(axis=1))
        if count > len(movable):
            raise PerturbationError(
                f"shot_noise: {count} spikes were requested, but only {len(movable)} of {len(mesh.vertices)} "
                "vertices have a normal; lower the amount or clean the mesh"
            )
        return {
            "vertices": rng.choice(movable, count, replace=False),
            "signs": rng.choice([-1.0, 1.0], count),
        }

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        spikes = parameters["vertices"]
        height = self.height * LENGTHS[self.height_unit](mesh)
        lengths = np.zeros(len(mesh.vertices))
        lengths[spikes] = height * parameters["signs"]
        result, counterpart, facts = displace(mesh, vertex_normals(mesh), lengths, self.name)
        return self.finish(mesh, result, counterpart, absolute_height=float(height), **facts)
