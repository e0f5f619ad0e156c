"""Several perturbations in a row."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb.decimation import Decimation
from perturb.meshes import as_trimesh
from perturb.micro_holes import MicroHoles
from perturb.normal_noise import NormalNoise
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    from collections.abc import Sequence

    import trimesh

    from perturb.perturbation import Scalar


def _scan() -> tuple[Perturbation, ...]:
    """What a scan does to a shape."""
    return NormalNoise(amount=0.3), MicroHoles(amount=0.02), Decimation(amount=0.5)


@dataclass(frozen=True)
class Composite(Perturbation):
    """Apply several perturbations one after the other, each to the result of the one before.

    Parameters
    ----------
    amount : float
        0 to 1: how far the amount of each step is on the way from its neutral one (0) to its own (1).
    unit : str
        "share_of_strength".
    steps : sequence of Perturbation
        At least one; by default noise, micro-holes and decimation, as in a scan. In YAML a list of mappings with
        ``_target_``. An amount that must be a whole number is rounded.

    Notes
    -----
    All steps draw from the same generator, in order. What a later step draws depends on its mesh, so `sample` applies
    the earlier ones. The counterpart of a vertex is the counterpart, in each step, of that in the step before.

    `Perturbed.applied` contains that of each step, with the prefix ``step_1_``, ``step_2_`` and so on; if counterparts
    of any step do not follow from the perturbation itself, ``counterpart_by`` names how those were found.

    Raises
    ------
    PerturbationError
        When built, also if one of the steps cannot have its share of the amount. When called, with the message of the
        step that cannot be applied.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> steps = [perturb.NormalNoise(amount=0.2), perturb.Decimation(amount=0.5)]
    >>> half = perturb.Composite(amount=0.5, steps=steps)
    >>> applied = half(trimesh.creation.icosphere(), np.random.default_rng(0)).applied
    >>> applied["step_1_amount"], applied["step_2_amount"], applied["faces_after"]
    (0.1, 0.75, 960)
    """

    amount: float = 1.0
    unit: str = "share_of_strength"
    steps: Sequence[Perturbation] = field(default_factory=_scan)

    name: ClassVar[str] = "composite"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("share_of_strength",)}

    def __post_init__(self) -> None:
        object.__setattr__(self, "steps", self._checked_steps())
        super().__post_init__()
        self.check_number("amount", maximum=1)
        self.scaled_steps()

    def _checked_steps(self) -> tuple[Perturbation, ...]:
        if isinstance(self.steps, str) or not hasattr(self.steps, "__iter__"):
            raise PerturbationError(f"composite: steps is {self.steps!r}; it must be a list of perturbations")
        steps = tuple(self.steps)
        for number, step in enumerate(steps, start=1):
            if not isinstance(step, Perturbation):
                raise PerturbationError(f"composite: step {number} is {step!r}; it must be a perturbation")
        if not steps:
            raise PerturbationError("composite: steps is empty; give at least one perturbation")
        return steps

    def scaled_steps(self) -> list[Perturbation]:
        """Return the steps with their share of the amount.

        Returns
        -------
        list of Perturbation

        Examples
        --------
        >>> import perturb
        >>> perturb.Composite(amount=0.25, steps=[perturb.Holes(amount=10)]).scaled_steps()
        [Holes(amount=2, unit='triangles')]
        """
        return [self._scaled(step) for step in self.steps]

    def _scaled(self, step: Perturbation) -> Perturbation:
        if self.amount == 1:
            return step
        amount = step.neutral + self.amount * (step.amount - step.neutral)
        try:
            return dataclasses.replace(step, amount=amount)
        except PerturbationError:  # of a perturbation that counts
            return dataclasses.replace(step, amount=round(amount))

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `steps`, a list of the parameters of each step."""
        steps = self.scaled_steps()
        drawn: list[Parameters] = []
        for step in steps:
            drawn.append(step.sample(mesh, rng))
            if len(drawn) < len(steps):
                mesh = step.apply(mesh, drawn[-1]).mesh
        return {"steps": drawn}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        counterpart = np.arange(len(mesh.vertices))
        result = as_trimesh(mesh.vertices, mesh.faces)
        facts: dict[str, Scalar] = {}
        found_by: list[Scalar] = []
        for number, (step, drawn) in enumerate(zip(self.scaled_steps(), parameters["steps"], strict=True), start=1):
            perturbed = step.apply(result, drawn)
            result = perturbed.mesh
            counterpart = np.where(counterpart < 0, -1, perturbed.counterpart[counterpart])
            facts |= {f"step_{number}_{key}": value for key, value in perturbed.applied.items()}
            found_by += [perturbed.applied["counterpart_by"]] if "counterpart_by" in perturbed.applied else []
        if found_by:
            facts["counterpart_by"] = ", ".join(dict.fromkeys(map(str, found_by)))
        return self.finish(mesh, result, counterpart, **facts)
