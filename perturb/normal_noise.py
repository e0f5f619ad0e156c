"""Noise on all vertices, along their normals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._displacement import displace, require_normals
from perturb.meshes import LENGTHS, vertex_normals
from perturb.perturbation import Parameters, Perturbation, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class NormalNoise(Perturbation):
    """Move every vertex along its angle-weighted normal by a random signed length.

    Parameters
    ----------
    amount : float
        The standard deviation (gaussian) or the largest length (uniform, in ±amount), in `unit`.
    unit : str
        "mean_edge_length" (how Table 2 is read here) or "bounding_box_diagonal" (Figure 9).
    distribution : str
        "gaussian" or "uniform".

    Notes
    -----
    Normals are those of `perturb.vertex_normals`, also meaningful on two-sided and inconsistently wound meshes.
    Vertices without a normal (without faces, or with only degenerate ones) do not move; `Perturbed.applied` counts
    them. If these are more than 1 % of the vertices with faces, a PerturbationError reports it, as it does if the
    coordinates are so large that the displacement is lost in their rounding. `Perturbed.applied` contains the largest
    displacement and, over the vertices that moved, the root mean square, in the mesh's own unit.

    References
    ----------
    Paper, section 6.3, which does not specify the unit of the levels in Table 2.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> noise = perturb.NormalNoise(amount=0.1, unit="bounding_box_diagonal")
    >>> inflated = noise.apply(sphere, {"lengths": np.ones(len(sphere.vertices))})
    >>> radius = np.linalg.norm(inflated.mesh.vertices, axis=1)
    >>> bool(np.allclose(radius, 1 + 0.1 * np.sqrt(12), atol=0.001))
    True
    """

    amount: float = 0.34
    unit: str = "mean_edge_length"
    distribution: str = "gaussian"

    name: ClassVar[str] = "normal_noise"
    version: ClassVar[int] = 2
    choices: ClassVar[dict[str, tuple[str, ...]]] = {
        "unit": tuple(LENGTHS),
        "distribution": ("gaussian", "uniform"),
    }

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `lengths` (n,): signed lengths as multiples of the amount."""
        n_vertices = len(mesh.vertices)
        if self.distribution == "gaussian":
            return {"lengths": rng.standard_normal(n_vertices)}
        return {"lengths": rng.uniform(-1.0, 1.0, n_vertices)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        scale = self.amount * LENGTHS[self.unit](mesh)
        normals = vertex_normals(mesh)
        if self.amount > 0:
            require_normals(normals, mesh, self.name)
        result, counterpart, facts = displace(mesh, normals, scale * parameters["lengths"], self.name)
        return self.finish(mesh, result, counterpart, absolute_amount=float(scale), **facts)
