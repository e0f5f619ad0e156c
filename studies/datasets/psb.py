"""The Princeton Segmentation Benchmark: 380 models of 19 categories, each segmented by several people.

X. Chen, A. Golovinskiy, T. Funkhouser, A Benchmark for 3D Mesh Segmentation, ACM Trans. Graph. 28 (3), 2009,
doi:10.1145/1531326.1531379.
"""

import difflib
import hashlib
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heatwalk.io import LoadedMesh, read_mesh, read_seg
from studies.datasets.dataset import Dataset, DatasetError, Model, check_there, natural_order, wanted
from studies.datasets.folders import find, folder, read

# The benchmark numbers its models by category; 261 to 280 are not part of it.
CATEGORIES = {
    "Human": range(1, 21),
    "Cup": range(21, 41),
    "Glasses": range(41, 61),
    "Airplane": range(61, 81),
    "Ant": range(81, 101),
    "Chair": range(101, 121),
    "Octopus": range(121, 141),
    "Table": range(141, 161),
    "Teddy": range(161, 181),
    "Hand": range(181, 201),
    "Plier": range(201, 221),
    "Fish": range(221, 241),
    "Bird": range(241, 261),
    "Armadillo": range(281, 301),
    "Bust": range(301, 321),
    "Mech": range(321, 341),
    "Bearing": range(341, 361),
    "Vase": range(361, 381),
    "FourLeg": range(381, 401),
}

# The paper's "non rigid" categories (Table 1). It does not name them; these eleven reproduce its figures.
NON_RIGID = (
    "Human",
    "Glasses",
    "Airplane",
    "Ant",
    "Octopus",
    "Teddy",
    "Hand",
    "Plier",
    "Bird",
    "Armadillo",
    "FourLeg",
)

_CATEGORY_OF = {str(number): category for category, numbers in CATEGORIES.items() for number in numbers}

_LAYOUT = """\
The Princeton Segmentation Benchmark (https://segeval.cs.princeton.edu), as a folder or as its zip, holds
    MeshsegBenchmark-1.0/data/off/1.off …                       the models
    MeshsegBenchmark-1.0/data/seg/Benchmark/1/1_0.seg …         the segmentations by people
Say where it is with dataset.root=PATH, or in the environment variable PSB_ROOT."""


@dataclass(frozen=True)
class PSBModel(Model):
    """A model of the benchmark, named by its number.

    Attributes
    ----------
    root : the benchmark's folder or zip
    data : where in it the folders ``off`` and ``seg`` are
    """

    root: Path
    data: str

    def load(self) -> LoadedMesh:
        return read(self._off(), read_mesh)

    def digest(self) -> str:
        return hashlib.sha256(self._off().read_bytes()).hexdigest()

    def human_segmentations(self) -> list[NDArray[np.int64]]:
        """One array of face labels (m,) a person, in the order of the benchmark's numbers for them."""
        return [read(file, read_seg) for file in self._people()]

    def people_digest(self) -> str:
        return hashlib.sha256(b"\0".join(file.read_bytes() for file in self._people())).hexdigest()

    def _people(self) -> list[Path | zipfile.Path]:
        people = folder(self.root, self.data) / "seg" / "Benchmark" / self.name
        if not people.is_dir():
            return []
        files = (file for file in people.iterdir() if file.name.endswith(".seg"))
        return sorted(files, key=lambda file: natural_order(file.name))

    def _off(self) -> Path | zipfile.Path:
        return folder(self.root, self.data) / "off" / f"{self.name}.off"


class PSB(Dataset):
    """The benchmark, or the part of it that is there, in the order of the models' numbers.

    Parameters
    ----------
    root : the unpacked benchmark (the folder above it, it, or its ``data``), or its zip, which stays packed
    categories : only models of these categories, in capitals or not; "non_rigid" for those of `NON_RIGID`; all without
    models : only models of these numbers; all without. Together with `categories`: those that satisfy both
    """

    name = "psb"

    def __init__(
        self,
        root: str | Path | None,
        categories: Sequence[str] | str | None = None,
        models: Sequence[int | str] | None = None,
    ):
        self._root = Path(root).expanduser().absolute() if root else None
        self._non_rigid = categories == "non_rigid"
        self._categories = None if self._non_rigid else wanted("categories", categories)
        self._names = wanted("models", models)

    def models(self) -> list[Model]:
        root, data = find(self._root, lambda inside: (inside / "off").is_dir(), _LAYOUT)
        files = {file.name for file in (folder(root, data) / "off").iterdir()}
        there = {name: category for name, category in _CATEGORY_OF.items() if f"{name}.off" in files}
        chosen = there
        if self._non_rigid:
            chosen = {name: category for name, category in there.items() if category in NON_RIGID}
        if self._categories is not None:
            categories = {_category(name) for name in self._categories}
            check_there("categories", categories, set(there.values()), ", ".join(dict.fromkeys(there.values())), root)
            chosen = {name: category for name, category in chosen.items() if category in categories}
        if self._names is not None:
            check_there("models", self._names, set(there), _spans(there), root)
            chosen = {name: category for name, category in chosen.items() if name in self._names}
        if not chosen:
            raise DatasetError(
                f"{root} has {len(there)} models of the benchmark, and dataset.categories and dataset.models "
                f"leave none of them"
            )
        return [PSBModel(name, category, root, data) for name, category in chosen.items()]


def _category(name: str) -> str:
    """The benchmark's own spelling of a category."""
    spelling = {category.lower(): category for category in CATEGORIES}
    if name.lower() in spelling:
        return spelling[name.lower()]
    near = difflib.get_close_matches(name.lower(), spelling, n=1)
    hint = f"did you mean {spelling[near[0]]}? " if near else ""
    raise DatasetError(f"the benchmark has no category {name!r}; {hint}It has {', '.join(CATEGORIES)}")


def _spans(names: Iterable[str]) -> str:
    """Ascending numbers, those that follow one another drawn together: "1-10, 21"."""
    numbers = np.array(list(names), dtype=int)
    spans = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return ", ".join(f"{span[0]}-{span[-1]}" if len(span) > 1 else f"{span[0]}" for span in spans if len(span))
