"""How far a segmentation moves when its mesh is perturbed."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

import perturb
from studies import metrics
from studies.columns import Column, Table, of_means
from studies.experiments import accuracy
from studies.experiments.accuracy import GroundTruth, missing_values
from studies.experiments.experiment import (
    FAILURES,
    PEAK_MEMORY,
    PUBLISHED,
    SEGMENTER,
    TRIALS,
    Experiment,
    by_segmenter,
    frame_of,
    measured_result,
    note_on_told,
    require_whole_number,
    told_methods,
)
from studies.experiments.pairing import check_paired_with, difference, difference_column, matched, rows_of
from studies.metrics import Comparison
from studies.planning.errors import StudyError
from studies.planning.fingerprint import TRIAL_ID_LENGTH, digest, digest_of_code, fingerprint
from studies.planning.plan import Block, Group
from studies.planning.targets import construct, locate
from studies.planning.trial import COLUMNS, Trial, planned_row
from studies.planning.trial_ids import TrialIds
from studies.planning.types import expectation, has_type, wrong_types
from studies.segmenters import Segmenter
from studies.statistics.bootstrap import NO_INTERVAL, interval_of_mean, model_mean, model_means_by

if TYPE_CHECKING:
    import pandas as pd
    import trimesh  # its import would take half of the time of a report

    from studies.datasets import Dataset, Model
    from studies.experiments.experiment import Labels
    from studies.figures.charts import Chart
    from studies.figures.pictures import Picture
    from studies.figures.variant_scenes import VariantScenes
    from studies.segmenters.segmenter import Labelled

MEASURE = "change_percentage"  # the metric that the tables and curves are about
SECONDS = ("seconds_perturb", "seconds_segment")
SIZES = ("n_segments", "n_segments_reference")
OF_STUDY = ("study", "repeats", "gallery", "page")  # options of a study that do not count where it is a part of another

PART = Column(name="part", dtype="string", heading="perturbation", help="Part of the study.")
LEVEL = Column(name="level", format="g", help="Amount of the perturbation.")
UNIT = Column(name="unit", dtype="string", compact=False, help="Unit of the level.")
CATEGORY = Column(name="category", dtype="string", help="Category of the models.")
MEAN = Column(
    name="mean",
    heading="CP %",
    format=".2f",
    unit="%",
    lower_is_better=True,
    help="Change Percentage: mean over models of the mean over repeats.",
)
BOUNDS = (
    Column(name="ci_low", shown=False, help="Lower end of the 95 % interval of the mean."),
    Column(name="ci_high", shown=False, help="Upper end of the 95 % interval of the mean."),
)
INTERVAL = Column(
    name="interval",
    heading="95 % interval",
    template="{ci_low:.2f} – {ci_high:.2f}",
    help="95 % bootstrap interval of the mean; models are resampled, then repeats.",
)
MEDIAN = Column(name="median", format=".2f", lower_is_better=True, help="Median over trials.")
SEGMENTS = Column(
    name="segments",
    heading="segments (original)",
    template="{n_segments:.1f} ({n_segments_reference:.1f})",
    compact=False,
    help="Mean number of segments after and before perturbing.",
)
FAILED_SHARE = Column(
    name="failed_share", heading="failed %", format=".1f", unit="%", lower_is_better=True, help="Trials that failed."
)
HIDDEN_SIZES = tuple(
    dataclasses.replace(column, dtype="float64", shown=False) for column in COLUMNS if column.name in SIZES
)


@dataclass(frozen=True)
class Reference:
    """A model's own mesh and its segmentation, and the segmenter for its variants."""

    mesh: trimesh.Trimesh
    labels: np.ndarray
    truth: GroundTruth | None = None
    segmenter: Segmenter | None = None


@dataclass(frozen=True)
class Variant:
    """A perturbed mesh and its segmentation, with the reference."""

    reference: Reference
    mesh: trimesh.Trimesh
    labels: np.ndarray
    counterpart: np.ndarray
    applied: Mapping[str, Any]
    seconds_perturb: float
    seconds_segment: float
    peak_memory: float | None = None
    labelled: Labelled | None = None

    def compared(self) -> tuple[np.ndarray, np.ndarray]:
        """Labels of the reference and of the variant at the vertices of the original that still exist."""
        kept = self.counterpart >= 0
        return self.reference.labels[kept], self.labels[self.counterpart[kept]]


@dataclass(frozen=True, kw_only=True)
class ChangeTrial(Trial):
    """One perturbation of one mesh, whose segmentation is compared with that of the original.

    Parameters
    ----------
    perturbation : Perturbation
        callable (trimesh.Trimesh, numpy.random.Generator) -> perturb.Perturbed
    segmenter : Segmenter
    draw : str
        digest of what determines the variant, whatever method segments it
    """

    perturbation: Callable[[trimesh.Trimesh, np.random.Generator], perturb.Perturbed]
    segmenter: Segmenter
    draw: str = ""

    def prepare(self) -> Reference:
        """The segmentation of the unperturbed mesh, and its ground truth if the model has one."""
        reference = self.reference()
        truth = GroundTruth.of(self.model, reference.mesh, reference.labels)
        return dataclasses.replace(reference, truth=truth)

    def reference(self, labels: np.ndarray | None = None) -> Reference:
        """The model's mesh with these labels, or segmented if there are none."""
        loaded = self.model.load()
        mesh = perturb.as_trimesh(loaded.vertices, loaded.faces)
        if labels is not None:
            return Reference(mesh, labels)
        segmenter = self.segmenter.for_original(mesh.vertices, mesh.faces)
        return Reference(mesh, segmenter(mesh.vertices, mesh.faces), segmenter=segmenter)

    def variant(
        self, reference: Reference, labels: np.ndarray | None = None, made: perturb.Perturbed | None = None
    ) -> Variant:
        """The perturbed mesh, if it is not ``made`` already, with these labels, or segmented if there are none."""
        original = reference.mesh
        perturbed, seconds_perturb = self.perturbed(original) if made is None else (made, 0.0)
        seconds_segment, megabytes, labelled = 0.0, None, None
        if labels is None:
            segmenter = reference.segmenter or self.segmenter.for_original(original.vertices, original.faces)
            labelled, seconds_segment, megabytes = measured_result(segmenter, perturbed.mesh)
            labels = labelled.labels
        return Variant(
            reference,
            perturbed.mesh,
            labels,
            perturbed.counterpart,
            perturbed.applied,
            seconds_perturb,
            seconds_segment,
            megabytes,
            labelled if self.keep_labels else None,
        )

    def perturbed(self, original: trimesh.Trimesh) -> tuple[perturb.Perturbed, float]:
        """The perturbed mesh, and the seconds that perturbing took."""
        start = time.perf_counter()
        perturbed = self.perturbation(original, np.random.default_rng(self.seed))
        return perturbed, time.perf_counter() - start

    def measure(self, prepared: Reference) -> dict[str, Any]:
        """Perturb, segment and compare."""
        reference, variant = prepared, self.variant(prepared)
        before, after = variant.compared()
        compared = Comparison(before, after, reference.mesh, np.flatnonzero(variant.counterpart >= 0))
        truth = reference.truth
        values = {
            "n_vertices": len(reference.mesh.vertices),
            "n_faces": len(reference.mesh.faces),
            "n_vertices_perturbed": len(variant.mesh.vertices),
            "n_faces_perturbed": len(variant.mesh.faces),
            "n_compared": len(before),
            "n_segments_reference": len(np.unique(reference.labels)),
            "n_segments": len(np.unique(variant.labels)),
            **metrics.compare(compared),
            **(truth.values(variant.counterpart, variant.labels) if truth else missing_values()),
            "seconds_perturb": variant.seconds_perturb,
            "seconds_segment": variant.seconds_segment,
            "peak_memory": variant.peak_memory,
            "applied": json.dumps(variant.applied),
        }
        return values | (self._kept(variant) if self.keep_labels else {})

    def _kept(self, variant: Variant) -> dict[str, np.ndarray]:
        """What the pictures and the page of the study show of this trial."""
        margin = variant.labelled.margin() if variant.labelled else None
        kept = {"labels": variant.labels, "reference_labels": variant.reference.labels}
        return kept if margin is None else {**kept, "margin": margin.astype(np.float32)}


@dataclass(frozen=True, kw_only=True)
class Part:
    """One perturbation of a study and its levels.

    Parameters
    ----------
    perturbation : mapping
        ``_target_``, the dotted name of a subclass of perturb.Perturbation, and its options
    levels : sequence of float
    title : str
    axis : str
        what the levels are, without their unit
    swept : str
        the option of the perturbation that the levels replace
    """

    perturbation: Mapping[str, Any] | None = None
    levels: Sequence[float] | None = None
    title: str = ""
    axis: str = ""
    swept: str = "amount"

    def at_levels(self, name: str) -> list[tuple[float, perturb.Perturbation]]:
        """Each level with the perturbation at that level; ``name`` is for error messages."""
        if not isinstance(self.perturbation, Mapping) or "_target_" not in self.perturbation:
            raise StudyError(f"the study {name!r} has no perturbation: perturbation=NAME, or perturbation._target_=…")
        for option, annotation in (("swept", str), ("axis", str), ("title", str)):
            if not isinstance(getattr(self, option), annotation):
                raise StudyError(f"{name}: {option} is {getattr(self, option)!r}: it must be {expectation(annotation)}")
        kind = locate("perturbation", self.perturbation["_target_"], StudyError)
        for option, expected in wrong_types(kind, self.perturbation).items():
            raise StudyError(f"{name}: perturbation.{option} is {self.perturbation[option]!r}: it must be {expected}")
        fields = [field.name for field in dataclasses.fields(kind)] if dataclasses.is_dataclass(kind) else []
        if self.swept not in fields:
            raise StudyError(f"{name}: swept is {self.swept!r}: it must be one of {', '.join(fields)}")
        return [
            (float(level), construct("perturbation", {**self.perturbation, self.swept: level}, StudyError))
            for level in _checked_levels(name, self.levels)
        ]

    def unit_of(self, perturbation: perturb.Perturbation) -> str:
        """Unit of the levels: the field ``unit`` for ``amount``, ``height_unit`` for ``height``."""
        return str(getattr(perturbation, "unit" if self.swept == "amount" else f"{self.swept}_unit", ""))

    def recipe(self, perturbation: perturb.Perturbation) -> dict[str, Any]:
        """What determines the perturbation, but for its level: class, options, and version or code."""
        options = {**(self.perturbation or {}), self.swept: None}
        if not str(options["_target_"]).startswith("perturb."):
            return {**options, "code": digest_of_code(type(perturbation))}
        defaults = {each.name: each.default for each in dataclasses.fields(perturbation)}
        for name in perturbation.later_fields:
            if options.get(name, defaults[name]) == defaults[name]:
                options.pop(name, None)
        # The first version is not recorded: trials had been stored before there were others.
        versioned = options if perturbation.version == 1 else {**options, "version": perturbation.version}
        return {**versioned, **_definition_of_steps(perturbation)}


def _definition_of_steps(perturbation: perturb.Perturbation) -> dict[str, Any]:
    """The versions, or the code, of what a composite consists of."""
    if not isinstance(perturbation, perturb.Composite):
        return {}
    return {
        "steps_defined_by": [
            (step.version, _definition_of_steps(step))
            if type(step).__module__.startswith("perturb.")
            else digest_of_code(type(step))
            for step in perturbation.steps
        ]
    }


def _checked_levels(name: str, levels: Any) -> Sequence[float]:
    """The levels of the part ``name``."""
    if not isinstance(levels, Sequence) or isinstance(levels, str):
        raise StudyError(f"{name}: levels is {levels!r}: it must be a list, as in 'levels=[0.1,0.2]'")
    if not levels:
        raise StudyError(f"{name}: levels is empty: give at least one, as in 'levels=[0.1,0.2]'")
    for level in levels:
        if not has_type(level, float):
            raise StudyError(f"{name}: levels contains {level!r}, which is not a number")
        if not math.isfinite(level):
            raise StudyError(f"{name}: levels contains {level!r}, which is not finite")
    if len(set(levels)) < len(levels):
        raise StudyError(f"{name}: levels contains a value twice: {list(levels)}")
    return levels


@dataclass(frozen=True)
class Level:
    """A perturbation of a study at one of its levels, with what determines it."""

    part: str
    level: float
    perturbation: perturb.Perturbation
    unit: str
    recipe: Mapping[str, Any]


class ChangeBlock(Block):
    """The trials of one model and one segmenter: every level, and every repeat of it.

    Parameters
    ----------
    study, dataset : str
        names
    model : Model
    segmenter : Segmenter
        for this model
    levels : sequence of Level
    repeats : int
    """

    def __init__(
        self, study: str, dataset: str, model: Model, segmenter: Segmenter, levels: Sequence[Level], repeats: int
    ) -> None:
        self.model = model
        self._names = {"study": study, "dataset": dataset}
        self._segmenter = segmenter
        self._levels = levels
        self._repeats = repeats
        self._kept: frozenset[int] = frozenset()

    def __len__(self) -> int:
        return len(self._levels) * self._repeats

    @cached_property
    def _method(self) -> list[Any]:
        return self._segmenter.fingerprint

    @cached_property
    def _identity(self) -> list[str]:
        return fingerprint(self.model)

    @property
    def ids(self) -> TrialIds:
        """The ids of the trials."""
        tail = "".join(f", {json.dumps(each, sort_keys=True)}" for each in self._method).encode()
        packed = bytearray()
        for level in self._levels:
            # As `trial` does it, but what all repeats share is hashed once.
            of_seed = _start_of_digest(level.part, self._identity, level.perturbation.name, level.level)
            of_trial = _start_of_digest(level.part, self._identity, level.recipe, level.level)
            for repeat in range(self._repeats):
                seed = of_seed.copy()
                seed.update(b"%d]" % repeat)
                trial = of_trial.copy()
                trial.update(b"%d, %d%b]" % (repeat, int(seed.hexdigest()[:15], 16), tail))
                packed += trial.digest()[: TRIAL_ID_LENGTH // 2]
        return TrialIds.of_bytes(packed)

    def trial(self, position: int) -> ChangeTrial:
        """The trial of a level and a repeat."""
        number, repeat = divmod(position, self._repeats)
        level = self._levels[number]
        # Neither the segmenter nor the perturbation's other options: methods, and ways to read the source of a
        # perturbation, are compared under the same draws.
        seed = int(digest(level.part, self._identity, level.perturbation.name, level.level, repeat)[:15], 16)
        drawn = level.part, self._identity, level.recipe, level.level, repeat, seed
        return ChangeTrial(
            **self._names,
            part=level.part,
            model=self.model,
            mesh_digest=self._identity[1],
            perturbation=level.perturbation,
            segmenter=self._segmenter,
            perturbation_name=level.perturbation.name,
            segmenter_name=self._segmenter.name,
            level=level.level,
            unit=level.unit,
            repeat=repeat,
            seed=seed,
            draw=digest(*drawn)[:TRIAL_ID_LENGTH],
            group_key=self._group_key,
            trial_id=digest(*drawn, *self._method)[:TRIAL_ID_LENGTH],
            keep_labels=position in self._kept,
        )

    @cached_property
    def _group_key(self) -> str:
        return digest(self._identity, *self._method)

    def keep_labels(self, trial_ids: AbstractSet[str]) -> None:
        """Have some of the `variants` keep their labels."""
        firsts = range(0, len(self), self._repeats)
        self._kept = frozenset(i for i in firsts if self.trial(i).trial_id in trial_ids)

    def method(self, position: int) -> tuple[str, str | None]:
        """The name of the segmenter, and its options as JSON."""
        return self._named_method

    @cached_property
    def _named_method(self) -> tuple[str, str | None]:
        return super().method(0)

    def examples(self) -> list[ChangeTrial]:
        """The first trial."""
        return [self.trial(0)]

    def variants(self) -> Iterator[ChangeTrial]:
        """The first repeat of each level."""
        return map(self.trial, range(0, len(self), self._repeats))

    def values(self, column: str) -> Iterable[Any]:
        """The values of a column."""
        if column == "repeat":
            return range(self._repeats)
        return [planned_row(trial).get(column) for trial in self.variants()]

    def groups(self, positions: NDArray[np.int64]) -> Iterator[Group]:
        """All trials share the segmentation of the model."""
        yield Group(self, positions)


def _start_of_digest(*parts: Any) -> hashlib._Hash:
    """What `digest` has hashed of ``parts`` before it comes to further ones."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True)[:-1].encode() + b", ")


@dataclass(frozen=True, kw_only=True)
class Gallery:
    """Which variants the gallery shows, and how.

    Parameters
    ----------
    models : int or list of str
        how many models, or which; 0 for no gallery
    columns : int
        most levels shown
    style : str
        variant, on_original, transparent, edges or scaled
    """

    models: int | Sequence[str | int] = 3
    columns: int = 6
    style: str = "variant"


@dataclass(frozen=True, kw_only=True)
class Viewer:
    """Which variants the viewer of the study's page shows.

    Parameters
    ----------
    models : int or list of str
        how many models, or which; 0 for no viewer
    columns : int
        most levels of each
    worst : int
        how many further variants, those whose segmentation changed most
    """

    models: int | Sequence[str | int] = 3
    columns: int = 6
    worst: int = 3


@dataclass(frozen=True, kw_only=True)
class Change(Experiment):
    """Change Percentage by level, of one perturbation or of several: the parts of the study.

    Parameters
    ----------
    perturbation, levels, title, axis, swept
        of a study with a single part, see `Part`
    parts : mapping of str to mapping, optional
        of a study with several parts: the same options for each, by name
    repeats : int
        trials of each model at each level, each with its own seed
    paired_with : str, optional
        one of several segmenters, by its name in the rows, from which the table has the differences of the others
    gallery : mapping, optional
        see `Gallery`
    page : mapping, optional
        see `Viewer`
    """

    perturbation: Mapping[str, Any] | None = None
    levels: Sequence[float] | None = None
    title: str = ""
    axis: str = ""
    swept: str = "amount"
    parts: Mapping[str, Mapping[str, Any]] | None = None
    repeats: int = 3
    paired_with: str | None = None
    gallery: Mapping[str, Any] | Gallery | None = field(default_factory=Gallery)
    page: Mapping[str, Any] | Viewer | None = field(default_factory=Viewer)

    def __post_init__(self) -> None:
        if not self.parts:
            if self.perturbation is not None:
                _checked_levels("levels" if not self.title else self.title, self.levels)
            return
        for option, default in (("perturbation", None), ("levels", None), ("axis", ""), ("swept", "amount")):
            if getattr(self, option) != default:
                raise StudyError(f"{option} is an option of each part of this study: parts.NAME.{option}=…")

    has_scenes: ClassVar[bool] = True
    columns: ClassVar[tuple[Column, ...]] = (*metrics.columns(), *accuracy.COLUMNS)
    notes: ClassVar[str] = (
        "Change Percentage (CP): twice the share of points that must change their segment, in percent, under the best"
        " one-to-one matching of segments; its mean over models and repeats, with the 95 % bootstrap interval (models"
        " resampled, then repeats). van Dongen: van Dongen's distance in percent, equal to CP if segments match one to"
        " one. Rand error: 1 − Rand index. Segments: their mean number after and before."
    )

    def plan(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> list[Trial]:
        """Every model under every segmenter, part, level and repeat."""
        return [trial for block in self._own_blocks(study, dataset, segmenters) for trial in block]

    def blocks(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> Iterable[Block]:
        """The trials of each model and segmenter, made when they are asked for."""
        if type(self).plan is not Change.plan:  # of a subclass, which plans other trials
            return super().blocks(study, dataset, segmenters)
        return self._own_blocks(study, dataset, segmenters)

    def _own_blocks(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> list[ChangeBlock]:
        check_paired_with(self.paired_with, segmenters)
        repeats = require_whole_number("repeats", self.repeats)
        levels = [
            Level(name, level, perturbation, part.unit_of(perturbation), part.recipe(perturbation))
            for name, part in self.named_parts(study).items()
            for level, perturbation in part.at_levels(name)
        ]
        blocks = [
            ChangeBlock(study, dataset.name, model, segmenter.for_model(model), levels, repeats)
            for model in dataset.models()
            for segmenter in segmenters
        ]
        return self._with_labels_of_gallery(blocks)

    def named_parts(self, study: str) -> dict[str, Part]:
        """The parts of the study by name; a study of a single perturbation is its own only part."""
        if not self.parts:
            options = {field.name: getattr(self, field.name) for field in dataclasses.fields(Part)}
            return {study: Part(**options)}
        return {name: _part(name, options) for name, options in self.parts.items()}

    def tables(self, rows: pd.DataFrame) -> list[Table]:
        """Change Percentage by part and level, and by category if there are several; accuracy, failures and seconds."""
        table = Table(
            name="table",
            frame=summary(rows, self.paired_with),
            columns=columns_by_level(rows, self.paired_with),
            notes=" ".join(filter(None, (self.notes, note_on_told(told_methods(rows))))),
            value="mean",
        )  # fmt: skip
        return [table, *filter(None, (_table_by_category(rows), _accuracy(rows), _failures_and_seconds(rows)))]

    def charts(self, study: str, tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> dict[str, Chart]:
        """A curve, or a panel per part."""
        from studies.figures import charts

        parts = self.named_parts(study)
        if len(parts) > 1:
            named = {name: (part.title, part.axis) for name, part in parts.items()}
            return {study: charts.part_panels(tables["table"], named, title)}
        (part,) = parts.values()
        return {study: charts.level_curve(tables["table"], rows, part.axis, title)}

    def pictures(
        self, study: str, trials: Sequence[Trial], rows: pd.DataFrame, title: str, labels: Labels
    ) -> Iterable[Picture]:
        """The gallery of segmented variants."""
        from studies.figures.gallery import GalleryPicture, choose_trials

        gallery = checked_gallery(self.gallery)
        good = set(rows.loc[rows["status"] == "ok", "trial_id"])
        chosen = choose_trials(trials, good, gallery.models, gallery.columns)
        if chosen:
            axes = {name: part.axis for name, part in self.named_parts(study).items()}
            yield GalleryPicture(chosen, rows, axes, gallery.style, title, labels)

    def scenes(self, trials: Sequence[Trial], rows: pd.DataFrame, labels: Labels) -> VariantScenes | None:
        """Originals and variants, those that changed most among them."""
        from studies.figures.gallery import choose_trials
        from studies.figures.variant_scenes import VariantScenes, choose_draws

        viewer = checked_viewer(self.page)
        good = set(rows.loc[rows["status"] == "ok", "trial_id"])
        chosen = choose_trials(trials, good, viewer.models, viewer.columns)
        draws = choose_draws(trials, rows, chosen, viewer.worst if chosen else 0, labels)
        return VariantScenes(draws) if draws else None

    def unwanted_pictures(self) -> Sequence[str]:
        """The gallery, if it is to show no model."""
        return ["gallery"] if checked_gallery(self.gallery).models == 0 else []

    def _with_labels_of_gallery(self, blocks: list[ChangeBlock]) -> list[ChangeBlock]:
        """The blocks; those trials that the gallery will show keep their labels."""
        from studies.figures.gallery import choose_models, choose_trials

        gallery = checked_gallery(self.gallery)
        names = choose_models([block.model.name for block in blocks], gallery.models)
        shown = [block for block in blocks if block.model.name in names]
        firsts = [trial for block in shown for trial in block.variants()]
        chosen = (
            {trial.trial_id for line in choose_trials(firsts, None, names, gallery.columns) for trial in line}
            if names
            else set()
        )
        for block in shown:
            block.keep_labels(chosen)
        return blocks


def checked_gallery(options: Mapping[str, Any] | Gallery | None) -> Gallery:
    """A gallery from its options.

    Raises
    ------
    StudyError
        if one of them is unknown, or has a wrong value
    """
    from studies.figures.gallery import STYLES

    if isinstance(options, Gallery):
        gallery = options
    else:
        target = {"_target_": f"{__name__}.Gallery"}
        gallery = construct("gallery", target | dict(options or {"models": 0}), StudyError)
    if isinstance(gallery.models, int) and gallery.models < 0:
        raise StudyError(f"gallery.models is {gallery.models}: it must be a whole number, or a list of names")
    require_whole_number("gallery.columns", gallery.columns)
    if gallery.style not in STYLES:
        raise StudyError(f"gallery.style is {gallery.style!r}: choose one of {', '.join(STYLES)}")
    return gallery


def checked_viewer(options: Mapping[str, Any] | Viewer | None) -> Viewer:
    """A viewer from its options.

    Raises
    ------
    StudyError
        if one of them is unknown, or has a wrong value
    """
    if isinstance(options, Viewer):
        viewer = options
    else:
        viewer = construct("page", {"_target_": f"{__name__}.Viewer"} | dict(options or {"models": 0}), StudyError)
    if isinstance(viewer.models, int) and viewer.models < 0:
        raise StudyError(f"page.models is {viewer.models}: it must be a whole number, or a list of names")
    require_whole_number("page.columns", viewer.columns)
    if isinstance(viewer.worst, bool) or viewer.worst < 0:
        raise StudyError(f"page.worst is {viewer.worst}: it must be a whole number")
    return viewer


def _part(name: str, options: Mapping[str, Any]) -> Part:
    """A part from its options, of which some belong to the study that they were taken from."""
    fields = {field.name for field in dataclasses.fields(Part)}
    if not isinstance(options, Mapping) or "perturbation" not in options or "levels" not in options:
        raise StudyError(f"parts.{name} needs a perturbation and levels")
    unknown = sorted(options.keys() - fields - set(OF_STUDY))
    if unknown:
        raise StudyError(f"parts.{name}.{unknown[0]} is not an option: a part has {', '.join(sorted(fields))}")
    return Part(**{key: value for key, value in options.items() if key in fields})


def columns_by_level(rows: pd.DataFrame, paired_with: str | None = None) -> tuple[Column, ...]:
    """The columns of `summary`, in the order in which they are shown."""
    paired = difference_column(paired_with, MEAN.title, format="+z.2f", lower_is_better=True)
    part = dataclasses.replace(PART, compact=rows["part"].nunique() > 1)
    median = dataclasses.replace(MEDIAN, compact=paired_with is None)  # there is room for one of the two
    further = _further_metrics(rows)
    before = (SEGMENTER, part, LEVEL, UNIT, MEAN, *BOUNDS, INTERVAL, paired, median, PUBLISHED)
    return (*before, *further, *HIDDEN_SIZES, SEGMENTS, TRIALS, FAILURES)


def summary(rows: pd.DataFrame, paired_with: str | None = None) -> pd.DataFrame:
    """Change Percentage by part and level, and by segmenter if there are several.

    Parameters
    ----------
    rows : DataFrame
        trials, as stored
    paired_with : str, optional
        segmenter from which the table has the differences of the others

    Returns
    -------
    DataFrame
        columns segmenter (if there are several), part, level, unit; mean, ci_low and ci_high (its 95 % interval),
        difference, difference_low and difference_high (with ``paired_with``), median; means of the other metrics and of
        the numbers of segments; n (trials that succeeded) and failures
    """
    keys = [*by_segmenter(rows), "part", "level", "unit"]
    means = [*(column.name for column in _further_metrics(rows)), *SIZES]
    rows = _narrow(rows, [*keys, "repeat", MEASURE, *means])
    records = []
    succeeded = rows[rows["status"] == "ok"]
    mean_of = model_means_by(succeeded, keys, [MEASURE, *means])
    others = rows_of(succeeded, paired_with)
    differences = None if others is None else _differences(succeeded, others, keys)
    for key, group in rows.groupby(keys, sort=False):
        good = group[group["status"] == "ok"]
        mean = mean_of.get(key, dict.fromkeys([MEASURE, *means], math.nan))
        records.append(
            {
                **dict(zip(keys, key, strict=True)),
                **_mean_and_interval(good, mean[MEASURE]),
                **({} if differences is None else differences.get(key, difference(math.nan, NO_INTERVAL))),
                **{name: mean[name] for name in means},
                "n": len(good),
                "failures": len(group) - len(good),
            }
        )
    return frame_of(records, [*keys, "mean", "n", "failures"])


def _narrow(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """The segmenter, model and status of rows, and some columns: those of groups are taken from it a thousand times.

    Words are Python's, of which pandas finds the different ones of a few rows in a third of the time of Arrow's.
    """
    import pandas as pd

    names = [name for name in dict.fromkeys(["segmenter", "model", "status", *columns]) if name in rows]
    narrow = rows[names]
    words = [name for name in names if isinstance(narrow[name].dtype, pd.StringDtype)]
    return narrow.astype(dict.fromkeys(words, object))


def _table_by_category(rows: pd.DataFrame) -> Table | None:
    """Change Percentage by part, level and category; None if there are not several categories."""
    if rows["category"].nunique() < 2:
        return None
    keys = [*by_segmenter(rows), "part", "level", "unit", "category"]
    good = _narrow(rows[rows["status"] == "ok"], [*keys, MEASURE])
    mean_of = model_means_by(good, keys, [MEASURE])
    frame = frame_of(
        (
            {
                **dict(zip(keys, key, strict=True)),
                **_mean_and_interval(group, mean_of[key][MEASURE]),
                "n": len(group),
            }
            for key, group in good.groupby(keys, sort=False)
        ),
        [*keys, "mean", "n"],
    )
    columns = (SEGMENTER, PART, LEVEL, UNIT, CATEGORY, MEAN, *BOUNDS, INTERVAL, MEDIAN, TRIALS)
    return Table("by_category", frame, columns)


def _accuracy(rows: pd.DataFrame) -> Table | None:
    keys = [*by_segmenter(rows), "part", "level", "unit"]
    return accuracy.accuracy_table(rows, keys, (SEGMENTER, PART, LEVEL, UNIT))


def _failures_and_seconds(rows: pd.DataFrame) -> Table | None:
    """The share of trials that failed, and what a trial costs; None if no row has its seconds.

    In a table of its own, because seconds and memory differ between runs, and the others do not.
    """
    timed = [column for column in COLUMNS if column.name in SECONDS and column.name in rows]
    if not timed or rows[[column.name for column in timed]].isna().all(axis=None):
        return None
    has_memory = PEAK_MEMORY.name in rows and rows[PEAK_MEMORY.name].notna().any()
    keys = [*by_segmenter(rows), "part", "level", "unit"]
    frame = frame_of(
        {
            **dict(zip(keys, key, strict=True)),
            FAILED_SHARE.name: 100 * float((group["status"] != "ok").mean()),
            **{column.name: model_mean(group[group["status"] == "ok"], column.name) for column in timed},
            **({PEAK_MEMORY.name: group[PEAK_MEMORY.name].median()} if has_memory else {}),
            "n": int((group["status"] == "ok").sum()),
        }
        for key, group in rows.groupby(keys, sort=False)
    )
    seconds = [dataclasses.replace(column, format=".3f") for column in timed]
    return Table(
        "failures_and_seconds", frame, (SEGMENTER, PART, LEVEL, UNIT, FAILED_SHARE, *seconds, PEAK_MEMORY, TRIALS)
    )


def _mean_and_interval(rows: pd.DataFrame, mean: float) -> dict[str, float]:
    low, high = interval_of_mean(rows, MEASURE)
    return {"mean": mean, "ci_low": low, "ci_high": high, "median": rows[MEASURE].median()}


def _differences(
    rows: pd.DataFrame, others: pd.DataFrame, keys: Sequence[str]
) -> dict[tuple[Any, ...], dict[str, float]]:
    """The means over models of the differences of Change Percentages under the same draws, and their intervals."""
    pairs = matched(rows, others, MEASURE, ["part", "level", "unit", "model", "repeat"])
    mean_of = model_means_by(pairs, keys, [MEASURE])
    return {
        key: difference(mean_of[key][MEASURE], interval_of_mean(group, MEASURE))
        for key, group in pairs.groupby(list(keys), sort=False)
    }


def _further_metrics(rows: pd.DataFrame) -> list[Column]:
    """The metrics that the table shows next to the Change Percentage: those that the rows have values of.

    Rows may be older than a metric, and words have no mean.
    """
    none_succeeded = not (rows["status"] == "ok").any()
    return [
        of_means(column)
        for column in metrics.columns()
        if column.name != MEASURE
        and column.dtype != "string"
        and column.name in rows
        and (none_succeeded or rows[column.name].notna().any())
    ]
