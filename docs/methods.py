"""The table of docs/segmenters.md: every method in conf/segmenter, as its class describes itself.

python docs/methods.py
"""

from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

import conf
from studies.segmenters import Segmenter, make_segmenter

FOLDER = Path(conf.__file__).parent / "segmenter"
HEADER = ("`segmenter=`", "method", "source", "told the number", "random", "needs", "licences of what it calls")


def methods() -> dict[str, Segmenter]:
    """The shipped methods by name; those that need further options, as a program of yours does, are none."""
    names = sorted(file.stem for file in FOLDER.glob("*.yaml"))
    with initialize_config_module("conf", version_base="1.3"):
        cfg = compose(overrides=[f"+segmenter@{name}={name}" for name in names])
    options: dict[str, Any] = OmegaConf.to_container(cfg)  # type: ignore[assignment]
    return {name: make_segmenter(each) for name, each in options.items() if "???" not in each.values()}


def table_of_methods() -> str:
    """The table as Markdown."""
    rows = [HEADER, ("---",) * len(HEADER), *(row(name, method) for name, method in methods().items())]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in rows)


def row(name: str, method: Segmenter) -> tuple[str, ...]:
    """What the table says about a method."""
    about = method.about
    if about is None:
        return (f"`{name}`", method.name, "", "", "", "", "")
    return (
        f"`{name}`",
        f"{about.title} (baseline)" if about.baseline else about.title,
        about.source,
        "yes" if method.is_told else "no",
        "seeded by the mesh" if about.seeded else "no",
        f"`pip install 'heatwalk[{about.extra}]'`" if about.extra else "",
        ", ".join(f"{package} ({licence})" for package, licence in about.licences.items()),
    )


if __name__ == "__main__":
    print(table_of_methods())
