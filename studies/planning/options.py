"""Options that are typed and would have no effect: refused, or said."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from omegaconf import DictConfig, OmegaConf

from studies.planning.command_line import CHOICES, OPTIONS_OF_PART, hint_for
from studies.planning.errors import StudyError

# Groups whose options are checked by the class or function that they are passed to.
CHECKED_LATER = ("dataset", "segmenter", "engine", "experiment", "perturbation", "hydra")
OPTIONS_OF_GROUP = {
    "study": ("name",),
    "trial": ("timeout", "memory"),
    "gallery": ("models", "columns", "style"),
}
OPTIONS_OF_ONE_PART = ("perturbation", "levels", "axis", "swept")
# Options of the study itself, whatever its experiment.
GENERAL = (
    "results_dir", "title", "publication", "on_error", "retry_failed", "fresh", "dry_run", "segmenters", "trial",
)  # fmt: skip

_REFERENCE = re.compile(r"\$\{(?:oc\.select:)?\s*([A-Za-z_]\w*)")


def check_added(cfg: DictConfig, overrides: Sequence[str]) -> tuple[str, ...]:
    """Refuse options that nothing uses, such as those that were added by ``+repeat=5``.

    Parameters
    ----------
    cfg : DictConfig
        the composed configuration
    overrides : sequence of str
        with which it was composed

    Returns
    -------
    tuple of str
        a line for each option that exists and has no effect on this study

    Raises
    ------
    StudyError
        if an option that was added, or belongs to another kind of study, has no effect
    """
    used = _used(cfg)
    unused = []
    for override in overrides:
        name, is_set, _ = override.partition("=")
        name, is_added = name.lstrip("+~").partition("@")[0], name.startswith("+")
        top, *below = name.split(".")
        if not is_set or (top in CHOICES and not below) or top in CHECKED_LATER[:4] or top == "hydra":
            continue
        if top in OPTIONS_OF_ONE_PART and cfg.get("parts"):
            names = ", ".join(f"parts.{part}.{'.'.join([top, *below])}" for part in cfg.parts)
            raise StudyError(f"{name} has no effect on the study {cfg.study.name}, which has parts: {names}")
        is_known = top in used or top in GENERAL or top in OPTIONS_OF_GROUP or top in ("repeats", "swept")
        if is_added and not (is_known and _is_option_of_group(top, below)):
            raise StudyError(f"{name} is not an option of the study {cfg.study.name}{_suggestion(name, cfg, used)}")
        if _is_replaced(name, cfg):
            unused.append(f"  {name} has no effect: the levels replace it")
        elif not (top in used or top in GENERAL or top == "study"):
            unused.append(f"  {name} has no effect on the study {cfg.study.name}")
    return tuple(unused)


def _used(cfg: DictConfig) -> set[str]:
    """The options of the study that its experiment, dataset, method or engine refers to."""
    content: Any = OmegaConf.to_container(cfg, resolve=False)
    texts = str([content.get(group) for group in CHECKED_LATER[:4]])
    return set(_REFERENCE.findall(texts))


def _is_replaced(name: str, cfg: DictConfig) -> bool:
    """Whether a name is that of the field of a perturbation that the levels replace."""
    before, _, field = name.rpartition(".")
    group, _, rest = before.rpartition("perturbation")
    if rest or not before.endswith("perturbation"):
        return False
    swept = OmegaConf.select(cfg, f"{group}swept") or cfg.get("swept")
    return field == swept


def _is_option_of_group(top: str, below: Sequence[str]) -> bool:
    if top in OPTIONS_OF_GROUP and below:
        return below[0] in OPTIONS_OF_GROUP[top]
    return not (top == "parts" and len(below) > 1) or below[1] in OPTIONS_OF_PART


def _suggestion(name: str, cfg: DictConfig, used: set[str]) -> str:
    """What may have been meant, as the end of a sentence."""
    content: Any = OmegaConf.to_container(cfg, resolve=False)
    known = [*used, *GENERAL]
    for group in (*used, "perturbation", *OPTIONS_OF_GROUP, *CHECKED_LATER[:3]):
        if isinstance(content.get(group), dict):
            known += [f"{group}.{key}" for key in content[group] if not str(key).startswith("_")]
    known = [each for each in dict.fromkeys(known) if each != name]
    return hint_for(name, sorted(known)).replace(" is an option of", ", but of").replace(": did", "; did") or "; see --help"
