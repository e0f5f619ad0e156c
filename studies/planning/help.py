"""What ``python -m studies.run --help`` prints: every study and option with its one line from the configuration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from studies._own_packages import CONF
from studies.storage.text import parse_yaml

# Groups of configurations in the order of the help, with the choice that is made if none is typed.
CHOICES = {"study": None, "dataset": "bundled", "segmenter": "heat_walk", "perturbation": None, "engine": "local"}
HELP_FLAGS = ("--help", "-h")

# What options of studies mean that their files do not explain.
MEANINGS = {
    "name": "of the folder of the results",
    "title": "over tables and curves",
    "axis": "what the levels are, under the curve",
    "levels": "amounts of the perturbation, in its unit",
}

_USAGE = """\
How far does a segmentation move when the mesh is perturbed?

Usage: python -m studies.run +study=NAME [dataset=NAME] [OPTION=VALUE ...]
"""
_EXAMPLES = """\
Examples
  python -m studies.run +study=shot_noise
  python -m studies.run +study=shot_noise --help          also lists the options of this study
  python -m studies.run +study=holes dataset=psb dataset.root=PATH 'dataset.categories=[Human,Ant]'
  python -m studies.run +study=normal_noise dataset=files 'dataset.glob=my/meshes/*.obj' repeats=5
  python -m studies.run +study=shot_noise 'levels=[0.1,0.2]' perturbation.height=2 engine.workers=4
  python -m studies.run +study=table1 dataset=synthetic segmenters=all
  python -m studies.run -m +study=holes,shot_noise segmenter.time=0.5,1,2

`--cfg job` prints the whole configuration of a study without running it."""


def help_text(arguments: Sequence[str]) -> str:
    """The help for a command with these arguments: names, options with their defaults, and what they mean.

    Parameters
    ----------
    arguments : sequence of str
        such as ``+study=holes`` and ``dataset=psb``, whose options are shown

    Examples
    --------
    >>> text = help_text(["dataset=files", "--help"])
    >>> "repeats: 3          # trials of each model" in text, "glob: null    # required" in text
    (True, True)
    """
    chosen = _chosen(arguments)
    lines = [_USAGE]
    for group in CHOICES:
        lines += [*_names(group), ""]
    lines += ["Options, with their defaults:", "", *_general_options(), ""]
    for group, name in chosen.items():
        if name is not None and (CONF / group / f"{name}.yaml").is_file():
            written = "OPTION=VALUE" if group == "study" else f"{group}.OPTION=VALUE"
            lines += [f"Options of {group}={name}, as {written}:", "", *_options(group, name), ""]
    return "\n".join([*lines, _EXAMPLES])


def _chosen(arguments: Sequence[str]) -> dict[str, str | None]:
    """The configuration of each group that the arguments, or the study, choose."""
    typed = dict(argument.lstrip("+").split("=", 1) for argument in arguments if "=" in argument)
    chosen = dict(CHOICES)
    study = CONF / "study" / f"{typed.get('study')}.yaml"
    if study.is_file():
        for default in parse_yaml(study.read_text("utf-8")).get("defaults", []):
            for key, name in default.items() if isinstance(default, dict) else ():
                group = key.removeprefix("override ").lstrip("/").partition("@")[0]
                if group in chosen and group != "study":
                    chosen[group] = name
    return chosen | {group: name for group, name in typed.items() if group in chosen}


def _names(group: str) -> Iterator[str]:
    """The configurations of a group, a line each: the first comment of the file."""
    files = sorted((CONF / group).glob("*.yaml"))
    width = max(len(file.stem) for file in files)
    yield f"{group}="
    for file in files:
        comment = next(line for line in file.read_text("utf-8").splitlines() if line[:2] == "# " and line[2] != "@")
        yield f"  {file.stem:<{width}}  {comment[2:]}"


def _general_options() -> Iterator[str]:
    """The options of every study, as the configuration writes them."""
    lines = (CONF / "config.yaml").read_text("utf-8").splitlines()
    kept = lines[lines.index(next(line for line in lines if line.startswith("repeats:"))) : lines.index("hydra:")]
    return (f"  {line}".rstrip() for line in _stripped(kept))


def _options(group: str, name: str) -> Iterator[str]:
    """The options of one configuration, as the file writes them."""
    lines = (CONF / group / f"{name}.yaml").read_text("utf-8").splitlines()
    kept, in_defaults = [], False
    for line in lines:
        in_defaults = line.startswith("defaults:") or (in_defaults and line.startswith((" ", "-")))
        is_internal = line.startswith(("#", "_recursive_", "_target_: studies.", "_target_: perturb."))
        if not (in_defaults or is_internal):
            meaning = MEANINGS.get(line.partition(":")[0].strip()) if group == "study" and "#" not in line else None
            kept.append(f"{line}  # {meaning}" if meaning else line)
    return (f"  {line}" for line in _stripped(kept))


def _stripped(lines: Sequence[str]) -> list[str]:
    """The lines without empty ones at the end."""
    kept = list(lines)
    while kept and not kept[-1].strip():
        kept.pop()
    return kept
