"""Anisotropic stretch and shear of the whole mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._displacement import deform
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Affine(Perturbation):
    """Stretch or shear the mesh along random axes, keeping its volume.

    Parameters
    ----------
    amount : float
        The ratio of the largest to the smallest stretch of a length, at least 1: the condition number of the linear
        map. 1 is the identity.
    unit : str
        "ratio_of_stretches".
    method : str
        "stretch": along three random perpendicular axes, of which the middle one is stretched by a random factor
        between the other two. "shear": planes slide along each other in a random direction.

    Notes
    -----
    The map has the determinant 1: what changes is the shape, not its size, for which there is `perturb.Scaling`. Its
    fixed point is the centre of the bounding box. A shear is a stretch by √amount and 1/√amount, followed by a
    rotation.

    References
    ----------
    A perturbation of SHREC's robustness tracks ("affine"), which do not say how it was drawn.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> stretched = perturb.Affine(amount=4).apply(box, {"axes": np.eye(3), "middle": 0.5})
    >>> stretched.mesh.extents.round(9).tolist()
    [2.0, 1.0, 0.5]
    """

    amount: float = 2.0
    unit: str = "ratio_of_stretches"
    method: str = "stretch"

    name: ClassVar[str] = "affine"
    neutral: ClassVar[float] = 1.0
    choices: ClassVar[dict[str, tuple[str, ...]]] = {
        "unit": ("ratio_of_stretches",),
        "method": ("stretch", "shear"),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.amount < 1:
            raise PerturbationError(f"affine: amount is {self.amount:g}; it must be at least 1, which is the identity")

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `axes` (3, 3), rows that are orthonormal, and `middle`, 0 to 1: where the middle stretch is."""
        orthonormal = np.linalg.qr(rng.standard_normal((3, 3))).Q
        return {"axes": orthonormal.T.copy(), "middle": float(rng.random())}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        change = self._change(parameters["axes"], parameters["middle"])
        offset = np.asarray(mesh.vertices) - mesh.bounds.mean(axis=0)
        result, counterpart, facts = deform(self, mesh, offset @ change.T)
        matrix = np.eye(3) + change
        return self.finish(
            mesh,
            result,
            counterpart,
            condition_number=float(np.linalg.cond(matrix)),
            volume_ratio=float(np.linalg.det(matrix)),
            **facts,
        )

    def _change(self, axes: np.ndarray, middle: float) -> np.ndarray:
        """(3, 3) the linear map minus the identity, which is exactly 0 for an amount of 1."""
        if self.method == "shear":
            slope = np.sqrt(self.amount) - 1 / np.sqrt(self.amount)
            return slope * np.outer(axes[0], axes[1])
        share = np.array([1.0, middle, 0.0])
        exponents = (share - share.mean()) * np.log(self.amount)
        return (axes.T * np.expm1(exponents)) @ axes
