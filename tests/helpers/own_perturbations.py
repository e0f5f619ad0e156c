"""Perturbations as an author outside this project writes them. Importing this module registers them."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import perturb


@dataclass(frozen=True)
class Shift(perturb.Perturbation):
    """Shift all vertices along x."""

    amount: float = 0.1
    unit: str = "mean_edge_length"

    name: ClassVar[str] = "shift"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": tuple(perturb.LENGTHS)}

    def apply(self, mesh, parameters):
        shift = self.amount * perturb.LENGTHS[self.unit](mesh)
        return self.finish(mesh, *perturb.moved(mesh, [shift, 0, 0]), shift=np.float64(shift))


@dataclass(frozen=True)
class Stretch(perturb.Perturbation):
    """Stretch along x; in the shortest form: no annotations of class variables, no defaults of fields."""

    name, choices = "stretch", {"unit": ("factor",)}

    def apply(self, mesh, parameters):
        return self.finish(mesh, *perturb.moved(mesh, mesh.vertices * [self.amount, 0, 0]))
