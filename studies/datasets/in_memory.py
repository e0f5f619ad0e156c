"""Models that are sent with their content, to workers that cannot read the files of this machine."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
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

    def method_digests(self) -> dict[str, str]:
        """The digests of the model's segmentations by methods."""
        return self.model.method_digests()

    def method_segmentation(self, method: str) -> NDArray[np.int64]:
        """The segmentation of the model by a method."""
        return self.model.method_segmentation(method)

    def correspondence(self) -> NDArray[np.int64]:
        """The correspondence of the model."""
        return self.model.correspondence()

    def correspondence_digest(self) -> str:
        """The digest of the model's correspondence."""
        return self.model.correspondence_digest()

    def __reduce__(self) -> tuple[Callable[..., Model], tuple[Any, ...]]:
        content = {name: _result_of(getattr(self.model, name)) for name in _CONTENT}
        methods = self.model.method_digests()
        by_methods = {method: _result_of(partial(self.model.method_segmentation, method)) for method in methods}
        return InMemoryModel, (self.name, self.category, content, by_methods)


def _result_of(function: Callable[[], Any]) -> Any:
    """What a function returns, or the exception that it raises: the worker raises it, if it asks for the result."""
    try:
        return function()
    except BaseException as error:
        if is_ctrl_c(error):
            raise
        return error


@dataclass(frozen=True)
class InMemoryModel(Model):
    """The content of a model, without its files.

    Parameters
    ----------
    content : dict
        name of a method of `Model` -> what it returns, or the exception that it raises
    by_methods : dict
        name of a segmentation method -> its segmentation of the model, or the exception that reading it raised
    """

    content: dict[str, Any]
    by_methods: dict[str, Any] = field(default_factory=dict)

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

    def method_segmentation(self, method: str) -> NDArray[np.int64]:
        """The segmentation by a method."""
        return _value_of(self.by_methods[method])

    def correspondence(self) -> NDArray[np.int64]:
        """The vertices at common points."""
        return self._result("correspondence")

    def _result(self, method: str) -> Any:
        """What a method of the original model returned; raises what it raised."""
        return _value_of(self.content[method])


def _value_of(result: Any) -> Any:
    """A result, which is raised if it is an exception."""
    if isinstance(result, BaseException):
        raise result
    return result


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
    for name in [each.name for each in dataclasses.fields(trial)]:  # type: ignore[arg-type]
        value = getattr(trial, name)
        if isinstance(value, Model):
            fields[name] = embed(value)
        elif isinstance(value, tuple) and any(isinstance(model, Model) for model in value):
            fields[name] = tuple(embed(each) if isinstance(each, Model) else each for each in value)
    return dataclasses.replace(trial, **fields)  # type: ignore[type-var]
