"""How far a segmentation moves when its mesh is perturbed (paper, sections 6.2 to 6.6, Table 2)."""

import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import hydra.utils
import numpy as np
import trimesh
from omegaconf import OmegaConf

from studies.execution import map_ordered
from studies.experiments.experiment import Claim, Experiment
from studies.metrics import change_percentage, rand_index_error, van_dongen
from studies.planning.code import digest_of_code
from studies.planning.plan import StudyError, digest, digests, identity, whole_number
from studies.planning.trial import Trial
from studies.segmenters import Segmenter
from studies.statistics import tables


@dataclass(frozen=True)
class Reference:
    """A model's own mesh and its segmentation."""

    mesh: trimesh.Trimesh
    labels: np.ndarray


@dataclass(frozen=True)
class Variant:
    """A perturbed mesh and its segmentation, beside the reference."""

    reference: Reference
    mesh: trimesh.Trimesh
    labels: np.ndarray
    counterpart: np.ndarray
    applied: dict
    seconds_perturb: float
    seconds_segment: float

    def compared(self):
        """Labels of the reference and of the variant at the vertices of the original that still exist."""
        kept = self.counterpart >= 0
        return self.reference.labels[kept], self.labels[self.counterpart[kept]]


@dataclass(frozen=True, kw_only=True)
class ChangeTrial(Trial):
    """One perturbation of one mesh, to be segmented and compared with the segmentation of the original.

    perturbation : callable (trimesh.Trimesh, numpy.random.Generator) -> perturb.Perturbed
    segmenter : studies.segmenters.Segmenter
    """

    perturbation: Callable
    segmenter: Segmenter

    def prepare(self):
        """The segmentation of the unperturbed mesh: Reference."""
        loaded = self.model.load()
        mesh = trimesh.Trimesh(loaded.vertices, loaded.faces, process=False)
        return Reference(mesh, self.segmenter(mesh.vertices, mesh.faces))

    def variant(self, reference):
        """Perturb and segment: the trial's geometry."""
        start = time.perf_counter()
        perturbed = self.perturbation(reference.mesh, np.random.default_rng(self.seed))
        middle = time.perf_counter()
        labels = self.segmenter(perturbed.mesh.vertices, perturbed.mesh.faces)
        end = time.perf_counter()
        return Variant(
            reference, perturbed.mesh, labels, perturbed.counterpart, perturbed.applied, middle - start, end - middle
        )

    def measure(self, reference):
        outcome = self.variant(reference)
        before, after = outcome.compared()
        return {
            "n_vertices": len(reference.mesh.vertices),
            "n_faces": len(reference.mesh.faces),
            "n_vertices_perturbed": len(outcome.mesh.vertices),
            "n_faces_perturbed": len(outcome.mesh.faces),
            "n_compared": len(before),
            "n_segments_reference": len(np.unique(reference.labels)),
            "n_segments": len(np.unique(outcome.labels)),
            "change_percentage": change_percentage(before, after),
            "van_dongen": van_dongen(before, after),
            "rand_index_error": rand_index_error(before, after),
            "seconds_perturb": outcome.seconds_perturb,
            "seconds_segment": outcome.seconds_segment,
            "applied": json.dumps(outcome.applied),
        }


class Change(Experiment):
    """Change Percentage by level of one perturbation, or of several: the study's parts."""

    headings: ClassVar[dict[str, str]] = tables.HEADINGS
    notes = (
        "Change Percentage (CP): twice the share of points that must change their segment, in percent, under the best"
        " one-to-one matching of segments; its mean over models and repeats, with the 95 % bootstrap interval (models"
        " resampled, then repeats). Paper: Benjamin et al. 2011, where it gives a figure; its models are not named. "
        "van Dongen: van Dongen's distance in percent, the same where segments match one to one. Rand error: 1 − Rand"
        " index. Segments: their mean number after and before."
    )

    def plan(self, cfg, dataset, segmenter):
        repeats = whole_number("repeats", cfg.repeats)
        perturbations = [
            (name, level, perturbation, part.swept, recipe | _version(recipe["_target_"], perturbation))
            for name, part in parts(cfg).items()
            for recipe in [OmegaConf.to_container(part.perturbation, resolve=True) | {part.swept: None}]
            for level, perturbation in _levels(name, part)
        ]
        trials = []
        study, method = cfg.study.name, segmenter.identity
        for model in dataset.models():
            mesh = identity(model)
            shares = digest(mesh, *method)
            for part, level, perturbation, swept, recipe in perturbations:
                # The seed leaves out the segmenter and the perturbation's other options: methods and readings are
                # compared under the same draws.
                seed_of = digests((part, mesh, perturbation.name, level))
                id_of = digests((part, mesh, recipe, level), method)
                unit = _unit(perturbation, swept)
                for repeat in range(repeats):
                    seed = int(seed_of(repeat)[:15], 16)
                    trials.append(
                        ChangeTrial(
                            study=study,
                            dataset=dataset.name,
                            part=part,
                            model=model,
                            mesh_digest=mesh[1],
                            perturbation=perturbation,
                            segmenter=segmenter,
                            perturbation_name=perturbation.name,
                            segmenter_name=segmenter.name,
                            level=level,
                            unit=unit,
                            repeat=repeat,
                            seed=seed,
                            group_key=shares,
                            trial_id=id_of(repeat, seed)[:24],
                        )
                    )
        return trials

    def tables(self, rows, cfg):
        # Beside a perturbation of the user's own, the paper's figures would be those of another.
        papers = {name: part.paper if _is_ours(part.perturbation._target_) else {} for name, part in parts(cfg).items()}
        found = {"table": tables.summary(rows, papers)}
        if rows["category"].nunique() > 1:
            found["by_category"] = tables.by_category(rows)
        return found

    def display(self, table):
        return tables.display(table)

    def narrow(self, table):
        several = table["part"].nunique() > 1
        return (*(["part"] if several else []), "level", "mean", "interval", "median", "paper", "n", "failures")

    def claims(self, tables, cfg):
        """Every level that the paper gives a figure for; of what it only shows, the level that its words are about."""
        found = []
        for row in tables["table"].itertuples():
            part = parts(cfg)[row.part]
            said = part.get("claim")
            if not math.isnan(row.paper):
                what = f"{part.title}: {row.level:g} {row.unit.replace('_', ' ')}"
            elif said and np.isclose(said.level, row.level):
                what = f"{part.title}: “{said.says}”"
            else:
                continue
            found.append(Claim(what, row.paper, row.mean, row.ci_low, row.ci_high, " %"))
        return found

    def curves(self, rows, tables, cfg, title):
        from studies.figures import curves as figures

        if len(parts(cfg)) > 1:
            named = {name: (part.title, part.axis) for name, part in parts(cfg).items()}
            return {cfg.study.name: figures.panels(tables["table"], named, title)}
        return {cfg.study.name: figures.curve(tables["table"], rows, cfg.axis, title)}

    def surfaces(self, trials, rows, cfg, title, engine):
        from studies.figures import curves as figures
        from studies.figures import surfaces as render

        style = cfg.gallery.style
        if style not in render.STYLES:
            raise StudyError(f"gallery.style is {style!r}: choose one of {', '.join(render.STYLES)}")
        shown = figures.gallery_trials(trials, rows, cfg.gallery.models, cfg.gallery.columns)
        axes = {name: part.axis for name, part in parts(cfg).items()}

        def make():
            # By the workers: where drawing off screen takes a process down, the study's results stand all the same.
            pictures = map_ordered(engine, render.pictures, [(of_model, style) for of_model in shown])
            return figures.gallery(list(zip(shown, pictures, strict=True)), rows, axes, style, title)

        if shown:
            yield "gallery", " ".join([style, *(trial.trial_id for line in shown for trial in line)]), make


def parts(cfg):
    """The parts of a study, each with title, axis, swept, paper, levels and perturbation: dict by name.

    A study of one perturbation is its own only part.
    """
    if not cfg.get("perturbation") and not cfg.get("parts"):
        raise StudyError(f"the study {cfg.study.name!r} says no perturbation")
    return cfg.get("parts") or {cfg.study.name: cfg}


def _levels(name, part):
    """(level, the perturbation at that level) of a part."""
    if not part.levels:
        raise StudyError(f"{name}: levels is empty: give at least one, as in 'levels=[0.1,0.2]'")
    if len(set(part.levels)) < len(part.levels):
        raise StudyError(f"{name}: levels holds a value twice: {list(part.levels)}")
    return [(float(level), hydra.utils.instantiate(part.perturbation, **{part.swept: level})) for level in part.levels]


def _is_ours(target):
    return target.startswith("perturb.")


def _version(target, perturbation):
    """What says by which code a perturbation works: the version of one of ours, the code itself of the user's own."""
    if not _is_ours(target):
        return {"code": digest_of_code(hydra.utils.get_object(target))}
    # A first version goes without saying: trials were stored before there were others.
    return {"version": perturbation.version} if perturbation.version > 1 else {}


def _unit(perturbation, swept):
    """The unit of the field that the levels stand for: ``unit`` of ``amount``, ``height_unit`` of ``height``."""
    return str(getattr(perturbation, "unit" if swept == "amount" else f"{swept}_unit", ""))
