"""A configuration becomes the list of its trials. Nothing is run here."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass

import hydra.utils
from omegaconf import OmegaConf

import heatwalk


class StudyError(ValueError):
    """A configuration that is not a study; the message says which option and what to type."""


@dataclass(frozen=True)
class Trial:
    """One perturbation of one mesh, to be segmented and compared: everything a worker needs, and small to send.

    study, dataset : names
    model : studies.datasets.Model, which loads its mesh when asked
    mesh : str, the model's digest
    perturbation : callable (trimesh.Trimesh, numpy.random.Generator) -> perturb.Perturbed
    segmenter : callable (vertices, faces) -> labels
    perturbation_name, segmenter_name : str
    segmenter_id : str, what determines the segmenter's results
    level : float, the amount in ``unit``
    repeat : int, 0 …
    seed : int, of the trial's own random generator
    trial_id : str, what determines the trial's result
    """

    study: str
    dataset: str
    model: object
    mesh: str
    perturbation: Callable
    segmenter: Callable
    perturbation_name: str
    segmenter_name: str
    segmenter_id: str
    level: float
    unit: str
    repeat: int
    seed: int
    trial_id: str


def plan(cfg):
    """The trials of a composed configuration, model by model, level by level.

    Parameters
    ----------
    cfg : omegaconf.DictConfig with dataset, perturbation, segmenter, study, levels, repeats

    Returns
    -------
    list of Trial

    Raises
    ------
    StudyError
        for levels or repeats that make no trial
    """
    if not cfg.levels:
        raise StudyError("levels is empty: give at least one, as in 'levels=[0.1,0.2]'")
    if len(set(cfg.levels)) < len(cfg.levels):
        raise StudyError(f"levels holds a value twice: {list(cfg.levels)}")
    if not (isinstance(cfg.repeats, int) and cfg.repeats >= 1):
        raise StudyError(f"repeats is {cfg.repeats!r}: give a whole number of at least 1")

    study = cfg.study.name
    dataset = hydra.utils.instantiate(cfg.dataset)
    segmenter = hydra.utils.instantiate(cfg.segmenter)
    segmenter_id = _digest(OmegaConf.to_container(cfg.segmenter, resolve=True), heatwalk.ALGORITHM_VERSION)
    perturbations = [hydra.utils.instantiate(cfg.perturbation, **{cfg.study.swept: level}) for level in cfg.levels]
    recipe = OmegaConf.to_container(cfg.perturbation, resolve=True) | {cfg.study.swept: None}

    trials = []
    for model in dataset.models():
        # The name too: the benchmark holds one mesh under two numbers.
        digest = model.digest()
        mesh = [model.name, digest]
        for level, perturbation in zip(cfg.levels, perturbations, strict=True):
            for repeat in range(cfg.repeats):
                # The seed leaves out the segmenter and the perturbation's other options: methods and readings are
                # compared under the same draws.
                seed = int(_digest(study, mesh, perturbation.name, float(level), repeat)[:15], 16)
                trials.append(
                    Trial(
                        study=study,
                        dataset=dataset.name,
                        model=model,
                        mesh=digest,
                        perturbation=perturbation,
                        segmenter=segmenter,
                        perturbation_name=perturbation.name,
                        segmenter_name=cfg.segmenter._target_.rsplit(".", 1)[-1],
                        segmenter_id=segmenter_id,
                        level=float(level),
                        unit=_unit(perturbation, cfg.study.swept),
                        repeat=repeat,
                        seed=seed,
                        trial_id=_digest(study, mesh, recipe, float(level), repeat, seed, segmenter_id)[:24],
                    )
                )
    return trials


def _unit(perturbation, swept):
    """The unit of the field that the levels stand for: ``unit`` of ``amount``, ``height_unit`` of ``height``."""
    return str(getattr(perturbation, "unit" if swept == "amount" else f"{swept}_unit", ""))


def _digest(*what):
    """SHA-256 of the JSON of ``what``: the same on every machine and in every process."""
    return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()
