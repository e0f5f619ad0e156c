"""Perturbations by the names of their studies: what an amount is, and what amounts are studied."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from studies._own_packages import CONF
from studies.experiments.change import Part
from studies.planning.errors import StudyError

if TYPE_CHECKING:
    import perturb

_OPTIONS = "perturbation"
_DEFAULT = f"/{_OPTIONS}@{_OPTIONS}"  # how a study with a single perturbation names it


@dataclass(frozen=True)
class NamedPerturbation:
    """A perturbation whose strength is still to be chosen.

    Parameters
    ----------
    name : str
        of its study, or of the perturbation if it has no study of its own
    part : Part
        its options, and the levels of the study
    """

    name: str
    part: Part

    @property
    def levels(self) -> Sequence[float]:
        """The levels of its study; without a study, the amount of the perturbation's own configuration."""
        return tuple(self.part.levels or ())

    @property
    def unit(self) -> str:
        """What an amount is, in words, such as "spikes, share of vertices"."""
        unit = self.part.unit_of(self.at(self.levels[0])).replace("_", " ")
        return ", ".join(filter(None, (self.part.axis, unit)))

    @property
    def default(self) -> float:
        """The level in the middle."""
        return self.levels[len(self.levels) // 2]

    def at(self, amount: float) -> perturb.Perturbation:
        """The perturbation with an amount in the unit of its study.

        Raises
        ------
        StudyError
            If it does not allow the amount.
        """
        return replace(self.part, levels=[amount]).at_levels(self.name)[0][1]


def named_perturbations() -> dict[str, NamedPerturbation]:
    """All perturbations with a configuration, and the studies of a single one, by name.

    Examples
    --------
    >>> named_perturbations()["shot_noise"].unit
    'spikes, share of vertices'
    >>> named_perturbations()["figure10"].at(0.4).height
    0.4
    """
    parts = {path.stem: _part_of_perturbation(_read(path)) for path in sorted((CONF / _OPTIONS).glob("*.yaml"))}
    for path in sorted((CONF / "study").glob("*.yaml")):
        study = _read(path)
        chosen = [each[_DEFAULT] for each in study.get("defaults", []) if isinstance(each, dict) and _DEFAULT in each]
        if chosen:
            options = {**(parts[chosen[0]].perturbation or {}), **study.get(_OPTIONS, {})}
            parts[path.stem] = Part(
                perturbation=options,
                levels=study["levels"],
                axis=study.get("axis", ""),
                swept=study.get("swept", "amount"),
            )
    return {name: NamedPerturbation(name, part) for name, part in sorted(parts.items())}


def perturbation_named(name: str) -> NamedPerturbation:
    """The perturbation of a name.

    Raises
    ------
    StudyError
        If there is none; the message lists all, with their units.
    """
    known = named_perturbations()
    if name not in known:
        names = "; ".join(f"{each.name} ({each.unit})" for each in known.values())
        raise StudyError(f"there is no perturbation {name!r}: choose one of {names}")
    return known[name]


def _part_of_perturbation(options: Mapping[str, Any]) -> Part:
    return Part(perturbation=options, levels=[options["amount"]])


def _read(path: Any) -> dict[str, Any]:
    """A configuration by itself, without what it builds on."""
    from omegaconf import OmegaConf

    read = OmegaConf.to_container(OmegaConf.create(path.read_text("utf-8")), resolve=False)
    return {str(key): value for key, value in read.items()} if isinstance(read, dict) else {}
