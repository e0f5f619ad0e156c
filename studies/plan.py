"""A configuration becomes the list of its trials. Nothing is run here."""

import hashlib
import json
from dataclasses import dataclass

import hydra.utils
from omegaconf import OmegaConf

import heatwalk
from studies.datasets import Dataset


class StudyError(ValueError):
    """A configuration that is not a study; the message says which option and what to type."""


@dataclass(frozen=True)
class Method:
    """A segmenter, and what determines its results.

    name : str
    segment : callable (vertices, faces) -> labels
    identity : str
    """

    name: str
    segment: object
    identity: str


def plan(cfg):
    """The trials of a composed configuration, model by model.

    Parameters
    ----------
    cfg : omegaconf.DictConfig with experiment, dataset, segmenter, study, and what the experiment asks for

    Returns
    -------
    list of studies.trial.Trial

    Raises
    ------
    StudyError
        for options that make no trial
    """
    return hydra.utils.instantiate(cfg.experiment).plan(cfg, dataset(cfg), method(cfg))


def dataset(cfg) -> Dataset:
    return hydra.utils.instantiate(cfg.dataset)


def method(cfg) -> Method:
    return Method(
        cfg.segmenter._target_.rsplit(".", 1)[-1],
        hydra.utils.instantiate(cfg.segmenter),
        digest(OmegaConf.to_container(cfg.segmenter, resolve=True), heatwalk.ALGORITHM_VERSION),
    )


def whole_number(name, value):
    """``value`` of the option ``name``, checked."""
    if not (isinstance(value, int) and value >= 1):
        raise StudyError(f"{name} is {value!r}: give a whole number of at least 1")
    return value


def identity(model):
    """What determines a model: the name too, because the benchmark holds one mesh under two numbers."""
    return [model.name, model.digest()]


def digest(*what):
    """SHA-256 of the JSON of ``what``: the same on every machine and in every process."""
    return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()
