"""Scaling of the whole mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb.meshes import as_trimesh
from perturb.perturbation import Parameters, Perturbation, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Scaling(Perturbation):
    """Multiply all coordinates by a factor. Deterministic.

    Parameters
    ----------
    amount : float
        The factor, above 0; 1 is the identity.
    unit : str
        "factor".

    References
    ----------
    Paper, section 6.6 and Figure 14.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> box = trimesh.creation.box(extents=[1, 2, 4])
    >>> perturb.Scaling(amount=1.5)(box, np.random.default_rng(0)).mesh.extents.tolist()
    [1.5, 3.0, 6.0]
    """

    amount: float = 1.5
    unit: str = "factor"

    name: ClassVar[str] = "scaling"
    neutral: ClassVar[float] = 1.0
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("factor",)}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", positive=True)

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        with np.errstate(over="ignore"):  # an overflow makes the result unusable, which `finish` reports
            vertices = self.amount * np.asarray(mesh.vertices)
        return self.finish(mesh, as_trimesh(vertices, mesh.faces), np.arange(len(vertices)))
