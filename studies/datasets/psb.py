"""The Princeton Segmentation Benchmark: 380 models of 19 categories, each segmented by several people.

X. Chen, A. Golovinskiy, T. Funkhouser, A Benchmark for 3D Mesh Segmentation, ACM Trans. Graph. 28 (3), 2009,
doi:10.1145/1531326.1531379.
"""

from __future__ import annotations

import difflib
import hashlib
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heatwalk.io import LoadedMesh, read_mesh, read_seg
from heatwalk.io.reading import split_suffix
from studies.datasets.dataset import (
    Dataset,
    DatasetError,
    Model,
    check_weld_option,
    most_frequent,
    natural_order,
    require_available,
    selected_names,
    welded_digest,
)
from studies.datasets.folders import find, folder, is_macos_metadata, read
from studies.reporting.text import count_of

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

# The "non rigid" categories of Benjamin et al. 2011, Table 1. They are not named there; these eleven reproduce its
# values.
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

PEOPLE = "Benchmark"  # the folder of people's segmentations

_CATEGORY_OF = {str(number): category for category, numbers in CATEGORIES.items() for number in numbers}

_LAYOUT = """\
The Princeton Segmentation Benchmark (https://segeval.cs.princeton.edu), a folder or a zip archive, contains
    MeshsegBenchmark-1.0/data/off/1.off …                       the models
    MeshsegBenchmark-1.0/data/seg/Benchmark/1/1_0.seg …         the segmentations by people
    MeshsegBenchmark-1.0/data/seg/RandCuts/1.seg …              those by methods, if any
Set its location by dataset.root=PATH, or by the environment variable PSB_ROOT."""


@dataclass(frozen=True)
class PSBModel(Model):
    """A model of the benchmark, named by its number.

    Parameters
    ----------
    root : Path
        folder or zip archive of the benchmark
    data : str
        path in it of the folder that contains ``off`` and ``seg``
    file : str
        name of the file of the mesh; by default the model's name with ``.off``
    weld : None, "exact" or float
        see `heatwalk.read_mesh`; faces keep their number and order, to which people's labels refer
    """

    root: Path
    data: str
    file: str = ""
    weld: str | float | None = None

    def load(self) -> LoadedMesh:
        """The mesh of the OFF file."""
        return read(self._off(), partial(read_mesh, weld=self.weld))

    def digest(self) -> str:
        """SHA-256 of the OFF file, and of how its vertices are merged if they are."""
        return welded_digest(hashlib.sha256(self._off().read_bytes()).hexdigest(), self.weld)

    def human_segmentations(self) -> list[NDArray[np.int64]]:
        """Segmentations by people.

        Returns
        -------
        list of (m,) int64 array
            face labels, one array per person, in the order of the numbers that the benchmark gives them
        """
        return [read(file, read_seg) for file in self._human_files()]

    def human_digest(self) -> str:
        """SHA-256 of the files of people's segmentations; "" if there are none."""
        files = self._human_files()
        return _digest_of(files) if files else ""

    def typical_n_segments(self) -> int | None:
        """The most frequent number of segments over people and over the models of the category that are available."""
        return _typical_n_segments(self.root, self.data, self.category)

    def method_digests(self) -> dict[str, str]:
        """SHA-256 of the files in the folders beside people's, by name of the folder: RandCuts and so on.

        A folder contains ``seg/RandCuts/1.seg``, or as people's ``seg/RandCuts/1/1_0.seg``, and need not have every
        model.
        """
        methods = {method: self._method_files(method) for method in _methods(self.root, self.data)}
        return {method: _digest_of(files) for method, files in methods.items() if files}

    def method_segmentation(self, method: str) -> NDArray[np.int64]:
        """The face labels in the file of a method; a ValueError if it has several for the model."""
        files = self._method_files(method)
        if len(files) != 1:
            found = count_of(len(files), "segmentation")
            raise ValueError(f"{method} has {found} of model {self.name}; one is expected")
        return read(files[0], read_seg)

    def _human_files(self) -> list[Path | zipfile.Path]:
        """The files of people's segmentations, in the order of their numbers."""
        return _seg_files(folder(self.root, self.data) / "seg" / PEOPLE / self.name)

    def _method_files(self, method: str) -> list[Path | zipfile.Path]:
        """The files of a method's segmentations of the model, of which there should be one."""
        segmentations = folder(self.root, self.data) / "seg" / method
        file = segmentations / f"{self.name}.seg"
        return [file] if file.is_file() else _seg_files(segmentations / self.name)

    def _off(self) -> Path | zipfile.Path:
        """The OFF file."""
        return folder(self.root, self.data) / "off" / (self.file or f"{self.name}.off")


class PSB(Dataset):
    """The benchmark, or the part of it that is available.

    Parameters
    ----------
    root : str, Path or None
        the unpacked benchmark (its folder, the one above, or its ``data``), or its zip archive, which stays packed
    categories : sequence of str, or "non_rigid", optional
        only models of these categories, in upper or lower case; "non_rigid" means those of `NON_RIGID`; all by default
    models : sequence of int or str, optional
        only models of these numbers; all by default. With ``categories``: models that satisfy both
    weld : None, "exact" or float
        merge coincident vertices of each mesh, see `heatwalk.read_mesh`

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> (folder / "data" / "off").mkdir(parents=True)
    >>> for number in (2, 10, 84):
    ...     (folder / "data" / "off" / f"{number}.off").touch()
    >>> [(model.name, model.category) for model in PSB(folder, categories=["Human"]).models()]
    [('2', 'Human'), ('10', 'Human')]
    """

    name = "psb"

    def __init__(
        self,
        root: str | Path | None,
        categories: Sequence[str] | str | None = None,
        models: Sequence[int | str] | None = None,
        weld: str | float | None = None,
    ):
        check_weld_option(weld)
        self._weld = weld
        self._root = Path(root).expanduser().absolute() if root else None
        self._non_rigid = categories == "non_rigid"
        self._categories = None if self._non_rigid else selected_names("categories", categories)
        self._names = selected_names("models", models)

    def models(self) -> list[Model]:
        """The models in the order of their numbers.

        Returns
        -------
        list of PSBModel

        Raises
        ------
        DatasetError
            If the benchmark is not available, if it does not have a category or model that was asked for, or if the
            two options together leave no model.
        """
        root, data = find(self._root, lambda inside: (inside / "off").is_dir(), _LAYOUT)
        files = _files(folder(root, data) / "off")
        available = {name: category for name, category in _CATEGORY_OF.items() if name in files}
        categories, names = self._selected_categories(available, root), set(available)
        if self._names is not None:
            require_available("models", self._names, names, _spans(available), root)
            names &= self._names
        models: list[Model] = [
            PSBModel(name, category, root, data, files[name], self._weld)
            for name, category in available.items()
            if name in names and category in categories
        ]
        if not models:
            raise DatasetError(
                f"{root} has {count_of(len(available), 'model')} of the benchmark, and dataset.categories and "
                "dataset.models select none of them"
            )
        return models

    def total(self) -> int:
        """How many models the benchmark has in the selected categories, whether they are available or not."""
        chosen = NON_RIGID if self._non_rigid else map(_category, self._categories or CATEGORIES)
        return sum(len(CATEGORIES[category]) for category in chosen)

    def _selected_categories(self, available: dict[str, str], root: Path) -> set[str]:
        """The categories that the option selects from those of the available models."""
        if self._non_rigid:
            return set(NON_RIGID)
        if self._categories is None:
            return set(available.values())
        categories = {_category(name) for name in self._categories}
        listing = ", ".join(dict.fromkeys(available.values()))
        require_available("categories", categories, set(available.values()), listing, root)
        return categories


def _methods(root: Path, data: str) -> list[str]:
    """The names of the folders beside people's, sorted."""
    if root.is_dir():
        return _folders_of_methods(root / data / "seg")
    return _methods_in_archive(root, data, root.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _methods_in_archive(root: Path, data: str, modified: int) -> list[str]:
    """As `_methods`, found once: that looks through all members of an archive."""
    return _folders_of_methods(folder(root, data) / "seg")


def _folders_of_methods(segmentations: Path | zipfile.Path) -> list[str]:
    """The names of the folders in the one of segmentations that are not people's, sorted."""
    if not segmentations.is_dir():
        return []
    folders = (child.name for child in segmentations.iterdir() if child.is_dir() and not is_macos_metadata(child.name))
    return sorted(name for name in folders if name != PEOPLE)


def _seg_files(segmentations: Path | zipfile.Path) -> list[Path | zipfile.Path]:
    """The .seg files in a folder, in the order of their numbers; none if there is no such folder."""
    if not segmentations.is_dir():
        return []
    files = (
        file
        for file in segmentations.iterdir()
        if file.name.lower().endswith(".seg") and not is_macos_metadata(file.name)
    )
    return sorted(files, key=lambda file: natural_order(file.name))


def _digest_of(files: Iterable[Path | zipfile.Path]) -> str:
    """SHA-256 of the content of files."""
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest()


@lru_cache(maxsize=64)
def _typical_n_segments(root: Path, data: str, category: str) -> int | None:
    """As `PSBModel.typical_n_segments`, counted once per process."""
    models = (PSBModel(str(number), category, root, data) for number in CATEGORIES[category])
    return most_frequent(len(set(file.read_bytes().split())) for model in models for file in model._human_files())


def _files(off: Path | zipfile.Path) -> dict[str, str]:
    """The files of the models by number: 1.off, or another format or compression that `heatwalk.read_mesh` reads."""
    files: dict[str, str] = {}
    for file in sorted(file.name for file in off.iterdir()):
        name, suffix = split_suffix(file)
        if not suffix or name not in _CATEGORY_OF:
            continue
        if name in files:
            raise DatasetError(f"{off} has model {name} both as {files[name]} and as {file}; keep one of them")
        files[name] = file
    return files


def _category(name: str) -> str:
    """The benchmark's spelling of a category."""
    spelling = {category.lower(): category for category in CATEGORIES}
    if name.lower() in spelling:
        return spelling[name.lower()]
    close = difflib.get_close_matches(name.lower(), spelling, n=1)
    hint = f"did you mean {spelling[close[0]]}? " if close else ""
    raise DatasetError(f"the benchmark has no category {name!r}; {hint}It has {', '.join(CATEGORIES)}")


def _spans(names: Iterable[str]) -> str:
    """Ascending numbers, consecutive ones combined: "1-10, 21"."""
    numbers = np.array(list(names), dtype=int)
    spans = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return ", ".join(f"{span[0]}-{span[-1]}" if len(span) > 1 else f"{span[0]}" for span in spans if len(span))
