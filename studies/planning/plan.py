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
    list of studies.planning.trial.Trial

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


def digests(what, rest=()):
    """A function: numbers -> ``digest(*what, *numbers, *rest)``, for many trials that differ in whole numbers alone."""
    begun = hashlib.sha256(json.dumps(what, sort_keys=True)[:-1].encode())
    end = "".join(f", {json.dumps(each, sort_keys=True)}" for each in rest) + "]"

    def of(*numbers):
        ended = begun.copy()
        ended.update(f"{''.join(f', {number}' for number in numbers)}{end}".encode())
        return ended.hexdigest()

    return of
