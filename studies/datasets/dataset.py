"""What a dataset is: a name, and a list of models that are read where they are needed."""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heatwalk.io import LoadedMesh


class DatasetError(ValueError):
    """A dataset that is not where it should be, or has not what was asked; the message says what to do."""


@dataclass(frozen=True)
class Model(ABC):
    """One shape of a dataset: small and picklable, so that it can be sent to the worker that reads the mesh.

    Attributes
    ----------
    name : unique within the dataset; may hold "/" where the models lie in folders
    category : the class of shapes it belongs to, "" where the dataset has none
    """

    name: str
    category: str

    @abstractmethod
    def load(self) -> LoadedMesh:
        """Read the mesh; raises `heatwalk.MeshError` where the file does not hold one."""

    @abstractmethod
    def digest(self) -> str:
        """SHA-256, in hexadecimal, of all that determines what `load` gives."""

    def human_segmentations(self) -> list[NDArray[np.int64]]:
        """Face labels (m,), one array a person, for the datasets that have them; else none."""
        return []

    def people_digest(self) -> str:
        """SHA-256 of all that determines what `human_segmentations` gives."""
        return ""

    def correspondence(self) -> NDArray[np.int64]:
        """The vertex of this pose for each point that the poses of its shape have in common: (p,)."""
        raise DatasetError(f"model {self.name}: its dataset does not say which points of two poses are the same")

    def correspondence_digest(self) -> str:
        """SHA-256 of all that determines what `correspondence` gives."""
        return ""


class Dataset(ABC):
    """A named collection of models. Making one reads nothing; `models` looks for the files.

    Attributes
    ----------
    name : stands in the rows of a study and in the path of its results
    """

    name: str

    @abstractmethod
    def models(self) -> list[Model]:
        """The models asked for, at least one, in an order that depends on nothing but their names.

        Raises
        ------
        DatasetError
            If the data are not there, or something that was asked for is not among them.
        """


def wanted(option: str, values: Iterable[str | int] | None) -> set[str] | None:
    """What an option such as dataset.models lists, as names; None where it leaves everything in."""
    if isinstance(values, str | int):
        raise DatasetError(f"dataset.{option}={values} must be a list: 'dataset.{option}=[{values}]'")
    return None if values is None else {str(value) for value in values}


def check_there(what: str, asked: set[str], there: set[str], listed: str, root: Path) -> None:
    """Refuse what was asked for and is not there, and say what is, as `listed`."""
    missing = sorted(asked - there, key=natural_order)
    if missing:
        raise DatasetError(f"{root} does not have the {what} {', '.join(missing)}; it has {listed or 'none'}")


def natural_order(name: str) -> list[tuple[int, str]]:
    """A sorting key that puts "model 2" before "model 10"."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"([0-9]+)", name)]
