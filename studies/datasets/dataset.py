"""The base classes of datasets: a dataset is a name and a list of models, which are read where they are needed."""

from __future__ import annotations

import hashlib
import inspect
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.welding import check_weld
from heatwalk.meshes import MeshError
from studies.planning.errors import StudyError
from studies.planning.names import check_name
from studies.planning.targets import check_required, construct, locate

if TYPE_CHECKING:
    from heatwalk.io import LoadedMesh

MOST_LISTED = 20  # names of models in a message

_EXAMPLES = {"_target_": "my_package.MyDataset", "glob": "my/meshes/**/*.off", "root": "PATH"}


class DatasetError(ValueError):
    """A dataset that is not available, or lacks what was asked for; the message tells what to do."""


@dataclass(frozen=True)
class Model(ABC):
    """One shape of a dataset: small and picklable, so that it can be sent to the worker that reads the mesh.

    Subclasses are frozen dataclasses whose fields locate the mesh.

    Parameters
    ----------
    name : str
        unique within the dataset; may contain "/" if the models are in folders
    category : str
        the class of shapes that it belongs to, "" if the dataset has none

    Attributes
    ----------
    ground_truth : bool
        whether `human_segmentations` returns one segmentation that is exact, instead of those by people

    Examples
    --------
    >>> import hashlib
    >>> import trimesh
    >>> from heatwalk.io import LoadedMesh
    >>> @dataclass(frozen=True)
    ... class Cylinder(Model):
    ...     sections: int
    ...
    ...     def load(self):
    ...         mesh = trimesh.creation.cylinder(1.0, 4.0, sections=self.sections)
    ...         return LoadedMesh(np.array(mesh.vertices), np.array(mesh.faces), ())
    ...
    ...     def digest(self):
    ...         return hashlib.sha256(f"cylinder {self.sections}".encode()).hexdigest()
    >>> Cylinder("fine", "cylinder", sections=32).load().faces.shape
    (128, 3)
    """

    name: str
    category: str

    ground_truth: ClassVar[bool] = False

    @abstractmethod
    def load(self) -> LoadedMesh:
        """Read or compute the mesh.

        Returns
        -------
        LoadedMesh
            vertices (n, 3) float64, faces (m, 3) int64 and notes; arrays that the caller may modify

        Raises
        ------
        heatwalk.MeshError
            If the file does not contain a mesh.
        """

    @abstractmethod
    def digest(self) -> str:
        """SHA-256, in hexadecimal, of all that determines the result of `load`.

        Returns
        -------
        str
            Part of the ids of trials: stored results are reused as long as it is the same.
        """

    def human_segmentations(self) -> list[NDArray[np.int64]]:
        """Segmentations by people.

        Returns
        -------
        list of (m,) int64 array
            face labels, one array per person, or the exact ones alone if there is a ground truth; empty if the dataset
            has none
        """
        return []

    def human_digest(self) -> str:
        """SHA-256 of all that determines the result of `human_segmentations`; "" if the dataset has none."""
        return ""

    def method_digests(self) -> dict[str, str]:
        """The methods whose segmentations of the model come with the dataset, as their authors computed them.

        Returns
        -------
        dict of str to str
            name of the method -> SHA-256 of all that determines the result of `method_segmentation`; empty if there are
            none
        """
        return {}

    def method_segmentation(self, method: str) -> NDArray[np.int64]:
        """The segmentation that comes with the dataset as the result of a method in `method_digests`.

        Parameters
        ----------
        method : str

        Returns
        -------
        (m,) int64 array
            face labels

        Raises
        ------
        ValueError
            If it cannot be read.
        """
        raise ValueError(f"model {self.name} has no segmentation by {method}")

    def typical_n_segments(self) -> int | None:
        """The number of segments that methods which need one are told to find.

        Returns
        -------
        int or None
            the most frequent number of segments in `human_segmentations`, the smallest of several; over all models of
            the category if the dataset says so. None if there are none.
        """
        return most_frequent(len(np.unique(labels)) for labels in self.human_segmentations())

    def correspondence(self) -> NDArray[np.int64]:
        """The vertices of this model at the points that all models of its category have in common.

        Returns
        -------
        (p,) int64 array
            Entry i of two models of one category is the same point of the shape.

        Raises
        ------
        DatasetError
            If the dataset does not specify corresponding points.
        """
        raise DatasetError(f"model {self.name}: its dataset does not specify corresponding points of two poses")

    def correspondence_digest(self) -> str:
        """SHA-256 of all that determines the result of `correspondence`; "" if the dataset specifies none."""
        return ""


class Dataset(ABC):
    """A named collection of models. Constructing one reads nothing; `models` looks for the files.

    Attributes
    ----------
    name : str
        value of the column ``dataset`` in the rows of a study, and the name of the folder of its results

    See Also
    --------
    studies.testing.check_dataset : checks that a dataset keeps to its contract

    Examples
    --------
    >>> from studies.datasets.bundled import Bundled
    >>> [model.name for model in Bundled(["cow", "ant"]).models()]
    ['ant', 'cow']
    """

    name: str

    @abstractmethod
    def models(self) -> Sequence[Model]:
        """The models that were asked for.

        Returns
        -------
        sequence of Model
            at least one; the order depends on nothing but their names

        Raises
        ------
        DatasetError
            If the data are not available, or something that was asked for is not among them.
        """

    def total(self) -> int | None:
        """How many models there are without the options that select some of them.

        Returns
        -------
        int or None
            None if that is not known
        """
        return None


def make_dataset(options: Mapping[str, Any]) -> Dataset:
    """The dataset that the options ``dataset.*`` describe.

    Parameters
    ----------
    options : mapping
        ``_target_``, the dotted name of a subclass of `Dataset` in an installed package or in the current folder;
        and the keyword arguments of that class. ``models``, a list of names, selects models of every dataset.

    Returns
    -------
    Dataset

    Raises
    ------
    DatasetError
        If an option is missing, unknown to the class, or refused by it, if the class cannot be imported, or if it is
        not a named `Dataset`.

    Examples
    --------
    >>> make_dataset({"_target_": "studies.datasets.bundled.Bundled", "models": ["cow"]}).models()
    [BundledModel(name='cow', category='animal')]
    """
    check_required("dataset", options, _EXAMPLES, DatasetError)
    options = dict(options)
    name = str(options.get("_target_"))
    target = locate("dataset", name, DatasetError)
    if not (isinstance(target, type) and issubclass(target, Dataset)):
        raise DatasetError(f"dataset._target_={name} is not a subclass of studies.datasets.Dataset")
    models = None
    if options.get("models") is None or "models" not in inspect.signature(target).parameters:
        models = selected_names("models", options.pop("models", None))
    _check_options(target, name, [key for key in options if not key.startswith("_")])
    dataset = construct("dataset", options, DatasetError)
    if not getattr(dataset, "name", None):
        raise DatasetError(f"dataset._target_={name} has no name: set the class attribute `name`")
    try:
        check_name("dataset.name", dataset.name)
    except StudyError as error:
        raise DatasetError(str(error)) from error
    return dataset if models is None else SelectedModels(dataset, models)


class SelectedModels(Dataset):
    """Some models of a dataset that has no option to select them.

    Parameters
    ----------
    dataset : Dataset
    names : set of str
    """

    def __init__(self, dataset: Dataset, names: set[str]):
        self.name = dataset.name
        self._dataset = dataset
        self._names = names

    def models(self) -> list[Model]:
        """The selected models, in the order of the dataset.

        Raises
        ------
        DatasetError
            If there is no model of a name that was asked for.
        """
        available = self._dataset.models()
        names = [model.name for model in available]
        require_available("models", self._names, set(names), listed_names(names), f"the dataset {self.name}")
        return [model for model in available if model.name in self._names]

    def total(self) -> int:
        """How many models the dataset has without this selection."""
        return self._dataset.total() or len(self._dataset.models())


def _check_options(target: type[Dataset], name: str, keys: Sequence[str]) -> None:
    """Refuse options that the class does not have."""
    try:
        inspect.signature(target).bind(**dict.fromkeys(keys))
    except TypeError as error:
        raise DatasetError(
            f"dataset._target_={name}: {error}; a dataset of your own has the options of dataset=custom and those "
            "given as +dataset.NAME=VALUE"
        ) from error


def selected_names(option: str, values: Iterable[str | int] | None) -> set[str] | None:
    """The names that an option such as dataset.models lists; None if it selects everything."""
    if isinstance(values, str | int):
        raise DatasetError(f"dataset.{option}={values} must be a list: 'dataset.{option}=[{values}]'")
    return None if values is None else {str(value) for value in values}


def require_available(what: str, requested: set[str], available: set[str], listing: str, root: Path | str) -> None:
    """Raise if anything requested is not available; the message lists what is, as ``listing``."""
    missing = sorted(requested - available, key=natural_order)
    if missing:
        raise DatasetError(f"{root} does not have the {what} {', '.join(missing)}; it has {listing or 'none'}")


def listed_names(names: Sequence[str]) -> str:
    """The first of some names, for a message."""
    return ", ".join(names[:MOST_LISTED]) + (", …" if len(names) > MOST_LISTED else "")


def most_frequent(numbers: Iterable[int]) -> int | None:
    """The most frequent of some numbers from 0, the smallest of several; None if there are none.

    Examples
    --------
    >>> most_frequent([7, 5, 5, 7, 3]), most_frequent([])
    (5, None)
    """
    counts = np.bincount(list(numbers) or [0])
    return int(counts.argmax()) or None


def natural_order(name: str) -> list[tuple[int, str]]:
    """A sorting key that puts "model 2" before "model 10"."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"([0-9]+)", name)]


def check_weld_option(weld: str | float | None) -> None:
    """Raise DatasetError unless a value of the option dataset.weld can be used."""
    try:
        check_weld(weld)
    except MeshError as error:
        raise DatasetError(f"dataset.{error}") from error


def welded_digest(digest: str, weld: str | float | None) -> str:
    """The digest of a model whose coincident vertices are merged: another model, unless ``weld`` is None."""
    return digest if weld is None else hashlib.sha256(f"{digest} weld={weld}".encode()).hexdigest()
