"""Drawing vertices, faces or edges of a mesh at random."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb.perturbation import Parameters, Perturbation, PerturbationError

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class OnShareOfFaces(Perturbation):
    """Base class of perturbations that do something to each of some faces."""

    amount: float = 0.1
    unit: str = "share_of_faces"

    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("share_of_faces",)}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=1)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `faces` (k,), uniformly and without replacement."""
        n_faces = len(mesh.faces)
        return {"faces": draw(self, np.arange(n_faces), round(self.amount * n_faces), rng, "faces")}


def draw(
    perturbation: Perturbation, candidates: np.ndarray, count: int, rng: np.random.Generator, what: str
) -> np.ndarray:
    """(count,) different candidates; PerturbationError if there are too few of them, which `what` names."""
    require_enough(perturbation, candidates, count, what)
    return rng.choice(candidates, count, replace=False)


def require_enough(perturbation: Perturbation, candidates: np.ndarray, count: int, what: str) -> None:
    """Raise PerturbationError if there are fewer candidates than requested."""
    if count > len(candidates):
        raise PerturbationError(
            f"{perturbation.name}: {count} {perturbation.unit} were requested, but the mesh has {len(candidates)} "
            f"{what}; lower the amount"
        )
