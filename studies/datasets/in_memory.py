"""Models that are sent with their content, to workers that cannot read the files of this machine."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from heatwalk.io import LoadedMesh
from studies.datasets.dataset import Model
from studies.execution.interruption import is_ctrl_c

AnyTrial = TypeVar("AnyTrial")

# The methods of a model that read its files.
_CONTENT = ("load", "human_segmentations", "correspondence")


@dataclass(frozen=True)
class EmbeddedModel(Model):
    """A model whose content is read when it is pickled: an `InMemoryModel` is what a worker unpickles.

    Parameters
    ----------
    model : Model
        the model, whose files can be read here
    """

    model: Model

    def load(self) -> LoadedMesh:
        """The mesh of the model."""
        return self.model.load()

    def digest(self) -> str:
        """The digest of the model."""
        return self.model.digest()

    def human_segmentations(self) -> list[NDArray[np.int64]]:
        """The segmentations of the model by people."""
        return self.model.human_segmentations()

    def human_digest(self) -> str:
        """The digest of the model's segmentations by people."""
        return self.model.human_digest()

    def correspondence(self) -> NDArray[np.int64]:
        """The correspondence of the model."""
        return self.model.correspondence()

    def correspondence_digest(self) -> str:
        """The digest of the model's correspondence."""
        return self.model.correspondence_digest()

    def __reduce__(self) -> tuple[Callable[..., Model], tuple[Any, ...]]:
        content: dict[str, Any] = {}
        for method in _CONTENT:
            try:
                content[method] = getattr(self.model, method)()
            except BaseException as error:
                if is_ctrl_c(error):
                    raise
                content[method] = error  # raised by the worker, if it calls the method at all
        return InMemoryModel, (self.name, self.category, content)


@dataclass(frozen=True)
class InMemoryModel(Model):
    """The content of a model, without its files.

    Parameters
    ----------
    content : dict
        name of a method of `Model` -> what it returns, or the exception that it raises
    """

    content: dict[str, Any]

    def load(self) -> LoadedMesh:
        """The mesh."""
        return self._result("load")

    def digest(self) -> str:
        """Not available: trials are planned where the files are.

        Raises
        ------
        NotImplementedError
            Always.
        """
        raise NotImplementedError(f"model {self.name} has no digest here; compute it where its files are")

    def human_segmentations(self) -> list[NDArray[np.int64]]:
        """The segmentations by people."""
        return self._result("human_segmentations")

    def correspondence(self) -> NDArray[np.int64]:
        """The vertices at common points."""
        return self._result("correspondence")

    def _result(self, method: str) -> Any:
        """What a method of the original model returned; raises what it raised."""
        if isinstance(self.content[method], BaseException):
            raise self.content[method]
        return self.content[method]


def embed_models(trial: AnyTrial) -> AnyTrial:
    """A copy of a trial whose models take their content along when it is pickled.

    Parameters
    ----------
    trial : dataclass
        a trial, with models, or tuples of models, in any of its fields

    Returns
    -------
    dataclass
        the trial with each `Model` replaced by an `EmbeddedModel`

    Examples
    --------
    >>> import pickle
    >>> from dataclasses import make_dataclass
    >>> from studies.datasets.bundled import BundledModel
    >>> trial = make_dataclass("Trial", ["model"])(BundledModel("cow", "animal"))
    >>> type(embed_models(trial).model).__name__
    'EmbeddedModel'
    >>> type(pickle.loads(pickle.dumps(embed_models(trial).model))).__name__
    'InMemoryModel'
    """
    embedded: dict[Model, EmbeddedModel] = {}  # one per model, or a pickle would hold its content repeatedly

    def embed(model: Model) -> EmbeddedModel:
        return embedded.setdefault(model, EmbeddedModel(model.name, model.category, model))

    fields: dict[str, Any] = {}
    for field in dataclasses.fields(trial):  # type: ignore[arg-type]
        value = getattr(trial, field.name)
        if isinstance(value, Model):
            fields[field.name] = embed(value)
        elif isinstance(value, tuple) and any(isinstance(model, Model) for model in value):
            fields[field.name] = tuple(embed(each) if isinstance(each, Model) else each for each in value)
    return dataclasses.replace(trial, **fields)  # type: ignore[type-var]
