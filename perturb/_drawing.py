"""Drawing vertices, faces or edges of a mesh at random."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from perturb.perturbation import PerturbationError

if TYPE_CHECKING:
    from perturb.perturbation import Perturbation


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
