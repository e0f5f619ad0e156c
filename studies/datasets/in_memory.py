"""Models that take their content along, to workers that do not see the files of this machine."""

import dataclasses
from dataclasses import dataclass

from studies.datasets.dataset import Model


@dataclass(frozen=True)
class EmbeddedModel(Model):
    """A model that is read when it is sent: what arrives elsewhere is `InMemoryModel`."""

    model: Model

    def load(self):
        return self.model.load()

    def digest(self):
        return self.model.digest()

    def __reduce__(self):
        read = {}
        for what in ("load", "human_segmentations", "correspondence"):
            try:
                read[what] = getattr(self.model, what)()
            except Exception as error:  # as it would have been raised there, if it is asked for at all
                read[what] = error
        return InMemoryModel, (self.name, self.category, read)


@dataclass(frozen=True)
class InMemoryModel(Model):
    """A model's content.

    read : dict, name of a method of `Model` -> what it gives, or the exception that it raises
    """

    read: dict

    def load(self):
        return self._give("load")

    def digest(self):
        raise NotImplementedError(f"model {self.name} is planned where its file is")

    def human_segmentations(self):
        return self._give("human_segmentations")

    def correspondence(self):
        return self._give("correspondence")

    def _give(self, what):
        if isinstance(self.read[what], Exception):
            raise self.read[what]
        return self.read[what]


def embed_models(trial):
    """A trial whose models, wherever in its fields, take their content along."""
    carriers = {}  # one a model, or a pickle would hold its content as often as it is named

    def carrier(model):
        return carriers.setdefault(model, EmbeddedModel(model.name, model.category, model))

    fields = {}
    for field in dataclasses.fields(trial):
        value = getattr(trial, field.name)
        if isinstance(value, Model):
            fields[field.name] = carrier(value)
        elif isinstance(value, tuple) and any(isinstance(model, Model) for model in value):
            fields[field.name] = tuple(map(carrier, value))
    return dataclasses.replace(trial, **fields)
