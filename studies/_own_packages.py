"""The packages of this project that studies need, found whatever lies in the current folder.

Python looks in the current folder first, and so would find a user's ``perturb.py`` instead of the package `perturb`.
"""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[1]  # the folder of the packages of this project
NAMES = ("heatwalk", "perturb")

#: The folder of the configuration, which is read as files: no package of another project can take its place.
CONF = ROOT / "conf"


class _OwnPackages(MetaPathFinder):
    """Finds the packages next to this one before all others of the same name."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The module of a top-level name of this project; None for any other."""
        return PathFinder.find_spec(fullname, [str(ROOT)]) if path is None and fullname in NAMES else None


def prefer_own_packages() -> None:
    """Have the packages next to this one imported instead of others of the same name.

    Raises
    ------
    ImportError
        If another module of such a name has been imported already.
    """
    for name in NAMES:
        if name in sys.modules and (origin := _origin(sys.modules[name])) and ROOT not in origin.resolve().parents:
            raise ImportError(
                f"studies needs its own package {name}, but {origin} has been imported under that name: "
                "rename it, or import studies first"
            )
    if not any(isinstance(finder, _OwnPackages) for finder in sys.meta_path):
        sys.meta_path.insert(0, _OwnPackages())


def _origin(module: ModuleType) -> Path | None:
    """The file or folder of a module; None if it has none."""
    origin = getattr(module, "__file__", None) or next(iter(getattr(module, "__path__", [])), None)
    return Path(origin) if origin else None
