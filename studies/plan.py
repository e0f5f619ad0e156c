"""A configuration becomes the list of its trials. Nothing is run here."""

import hashlib
import json

import hydra.utils

from studies import segmenters


class StudyError(ValueError):
    """A configuration that is not a study; the message says which option and what to type."""


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
    dataset = hydra.utils.instantiate(cfg.dataset)
    return hydra.utils.instantiate(cfg.experiment).plan(cfg, dataset, segmenters.make(cfg.segmenter))


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


def opening(*what):
    """A function: ``more`` -> ``digest(*what, *more)``. For the many trials that begin alike, and end in something."""
    begun = hashlib.sha256(json.dumps(what, sort_keys=True)[:-1].encode())

    def closed(*more):
        ended = begun.copy()
        ended.update(f", {json.dumps(more, sort_keys=True)[1:]}".encode())
        return ended.hexdigest()

    return closed
