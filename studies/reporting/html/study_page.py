"""The page of a study: what was run, what it amounts to, and the surfaces behind it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from studies.columns import Column, Table, is_missing
from studies.reporting.html.board_page import board_blocks, board_table, methods_block
from studies.reporting.html.packing import PackedScenes
from studies.reporting.html.page import (
    INDEX_FILE,
    REPORT_FILE,
    Block,
    Cell,
    ChartBlock,
    Facts,
    Heading,
    Page,
    PictureBlock,
    TableBlock,
    Text,
    ViewerBlock,
    stored_scenes,
)
from studies.reporting.html.svg import Mark, drawings
from studies.reporting.sweeps import Sweep
from studies.reporting.text import count_of, in_words, plain_text
from studies.storage.folders import planned_ids
from studies.storage.records import PROVENANCE_FILE, read_provenance

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from studies.figures.charts import Chart
    from studies.reporting.results import Results

VALUE = "change_percentage"
AGAINST_PEOPLE = "rand_index_error"  # of a study that compares with segmentations by people
WORST_SHOWN = 30
MOST_NAMED = 8  # methods
FAILURES_SHOWN = 200
MOST_MARKS = 2500  # trials of a chart that are a point each; of more, each model has one per level
NO_SCENES = (
    "There is no viewer: it is made where the models are, by the command above, which computes no stored trial again."
)
GALLERY = "gallery"  # the picture that the viewer takes the place of


def study_page(
    results: Results, scenes: PackedScenes | None = None, up: str = "", others: Sequence[Block] = ()
) -> Page:
    """The page of a study.

    Parameters
    ----------
    results : Results
    scenes : PackedScenes, optional
        of the viewer
    up : str
        address of the index
    others : sequence of Block
        what a kind of study adds, after its tables
    """
    from studies.experiments.leaderboard import Leaderboard

    rows = results.rows
    numbers = scenes.numbers if scenes else {}
    is_board = isinstance(results.experiment, Leaderboard)
    charts = results.experiment.charts(results.name, results.report_tables, rows, results.title)
    blocks = [
        _facts(results),
        *_findings(results),
        *_claims(results),
        board_table(results) if is_board else TableBlock.of(results.main_table, "Results"),
        *(board_blocks(results, charts, numbers) if is_board else _charts(results, charts, numbers)),
        *_viewer(results, scenes),
        *([methods_block(results)] if is_board else []),
        *_worst(rows, numbers),
        *_failures(rows),
        *_by_model(rows, numbers),
        *(TableBlock.of(table, table.title) for table in list(results.report_tables.values())[1:] if table.visible()),
        *others,
        *_pictures(results, charts),
    ]
    return Page(results.title, blocks, scenes=scenes, up=up)


def write_study_page(results: Results, scenes: PackedScenes | None = None, root: Path | None = None) -> None:
    """Write the page next to the tables of a study; without ``scenes``, those of the page that is there stay.

    Parameters
    ----------
    results : Results
    scenes : PackedScenes, optional
    root : Path, optional
        the folder of the index, to which the page links
    """
    path = results.folder / REPORT_FILE
    up = ""
    if root is not None:
        depth = len(results.folder.relative_to(root).parts)
        up = f"{'../' * depth}{INDEX_FILE}"
    study_page(results, scenes or stored_scenes(path), up).write(path)


def _facts(results: Results) -> Facts:
    """What was run: study, data, versions, trials, time, and the commands."""
    rows = results.rows
    origin = _provenance(results.folder)
    packages = origin.get("packages") or {}
    planned = planned_ids(results.folder)
    trials = f"{len(rows):,}"
    if planned is not None and len(set(planned)) > len(rows):
        trials += f" of {len(set(planned)):,} that are planned"
    seconds = sum(float(rows[name].sum()) for name in ("seconds_perturb", "seconds_segment") if name in rows)
    versions = [f"heatwalk {origin['version']}"] if origin.get("version") else []
    versions += [f"{name} {packages[name]}" for name in ("numpy", "scipy", "trimesh") if name in packages]
    categories = [str(each) for each in rows["category"].dropna().unique() if each]
    facts = {
        "study": results.name,
        "dataset": results.dataset,
        "models": results.subset or f"{len(results.models):,}",
        "categories": ", ".join(categories) if 1 < len(categories) <= 20 else "",
        "methods": ", ".join(results.methods) if len(results.methods) <= MOST_NAMED else f"{len(results.methods)}",
        "trials": trials,
        "failed": f"{results.failures:,}",
        "time": _duration(seconds) if seconds else "",
        "made": str(origin.get("made", "")).replace("T", " ").partition("+")[0],
        "versions": ", ".join(versions),
        "commit": str(origin.get("commit") or "")[:12],
    }
    commands = [each for each in (*results.earlier_commands, results.command) if each]
    return Facts("", [(name, value) for name, value in facts.items() if value], commands)


def _provenance(folder: Path) -> Mapping[str, Any]:
    """What is stored about the origin of results; nothing if it is missing or damaged."""
    try:
        return read_provenance(folder) if (folder / PROVENANCE_FILE).exists() else {}
    except (OSError, ValueError):
        return {}


def _duration(seconds: float) -> str:
    """Seconds in words.

    Examples
    --------
    >>> _duration(5.24), _duration(150), _duration(8000)
    ('5.2 s', '2.5 min', '2.2 h')
    """
    if seconds < 60:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} min" if seconds < 3600 else f"{seconds / 3600:.1f} h"


def _findings(results: Results) -> list[Text]:
    argument = results.publication.argument if results.publication else None
    found = results.experiment.findings(results.rows, argument)
    return [Text("", [plain_text(found)])] if found else []


def _claims(results: Results) -> list[TableBlock]:
    """What a publication claims, next to what was found."""
    claims = results.claims()
    if not claims or results.publication is None or results.dataset not in results.publication.datasets:
        return []
    remark = results.publication.remark(results.name, results.rows)
    return [claims_table(claims, "Next to the paper", plain_text(remark))]


def _charts(results: Results, charts: Mapping[str, Chart], numbers: Mapping[str, int]) -> list[ChartBlock]:
    """The charts of the study, with a point for each trial."""
    blocks = []
    for stem, chart in charts.items():
        has_curves = stem == results.name and all(panel.kind == "panel" for panel in chart.panels)
        marks = _marks(results, numbers) if has_curves else {}
        heading = "By level" if marks else "Chart" if stem == results.name else in_words(stem)
        notes = chart.subtitle
        if marks:
            points = "points: single trials" if _are_single(results.rows) else "points: means of each model"
            notes = f"{notes}; {points}" if notes else points
            if numbers:
                notes += "; those with an edge are single trials that the viewer shows when they are clicked"
        blocks.append(ChartBlock(heading, drawings(chart, marks), notes))
    return blocks


def _are_single(rows: pd.DataFrame) -> bool:
    """Whether charts show every trial as a point."""
    return int((rows["status"] == "ok").sum()) <= MOST_MARKS


def _marks(results: Results, numbers: Mapping[str, int]) -> dict[int, list[Mark]]:
    """A point for each trial that succeeded, by the number of its panel; of very many, one for each model and level."""
    from studies.experiments.change import Change

    rows = results.rows
    if not isinstance(results.experiment, Change):
        return {}
    good = rows[(rows["status"] == "ok") & rows[VALUE].notna()]
    methods = list(dict.fromkeys(rows["segmenter"].astype(str)))
    parts = list(dict.fromkeys(rows["part"].astype(str)))
    keys = ["part", "segmenter", "model", "level"]
    single = _are_single(rows)
    frame = good if single else good.groupby(keys, sort=False)[VALUE].mean().reset_index()
    marks: dict[int, list[Mark]] = {}
    for row in frame.to_dict("records"):
        place = f"{row['model']}, level {row['level']:g}"
        place += f", repeat {row['repeat']}" if single else ", mean of its repeats"
        method = f", {row['segmenter']}" if len(methods) > 1 else ""
        marks.setdefault(parts.index(str(row["part"])), []).append(
            Mark(
                float(row["level"]),
                float(row[VALUE]),
                f"{place}{method}: {row[VALUE]:.2f} %",
                methods.index(str(row["segmenter"])),
                numbers.get(str(row.get("trial_id")), -1),
            )
        )
    if not single:
        by_place = {
            (str(row["part"]), str(row["segmenter"]), str(row["model"]), row["level"]): row
            for row in good.to_dict("records")
            if str(row["trial_id"]) in numbers
        }
        for (part, method, model, level), row in by_place.items():
            text = f"{model}, level {level:g}, repeat {row['repeat']}, {method}: {row[VALUE]:.2f} %"
            mark = Mark(float(level), float(row[VALUE]), text, methods.index(method), numbers[str(row["trial_id"])])
            marks[parts.index(part)].append(mark)
    # Those that can be clicked are on top.
    return {panel: sorted(each, key=lambda mark: mark.scene >= 0) for panel, each in marks.items()}


def _viewer(results: Results, scenes: PackedScenes | None) -> list[ViewerBlock]:
    if scenes is None and not results.experiment.has_scenes:
        return []
    gallery = results.folder / f"{GALLERY}.png"
    fallback = PictureBlock.of(gallery, "", 1200) if gallery.exists() else None
    return [ViewerBlock("Surfaces", NO_SCENES, fallback)]


def _worst(rows: pd.DataFrame, numbers: Mapping[str, int]) -> list[TableBlock]:
    """The trials whose segmentation changed most."""
    if VALUE not in rows or not rows["perturbation"].fillna("").astype(bool).any():
        return []
    good = rows[(rows["status"] == "ok") & (rows[VALUE] > 0)]
    worst = good.sort_values(VALUE, ascending=False, kind="stable").head(WORST_SHOWN)
    if worst.empty:
        return []
    table = Table("worst", worst, _columns(rows, VALUE, "n_segments_reference", "n_segments"))
    block = TableBlock.of(table, "Worst cases")
    linked = [
        [_with_scene(row[0], numbers.get(str(trial_id), -1)), *row[1:]]
        for row, trial_id in zip(block.rows, worst["trial_id"], strict=True)
    ]
    notes = f"The {len(worst)} largest of {count_of(len(good), 'trial')} that changed."
    return [TableBlock(block.heading, block.headings, linked, notes)]


def _with_scene(cell: Cell, scene: int) -> Cell:
    return Cell(cell.text, cell.order, scene=scene)


def _failures(rows: pd.DataFrame) -> list[TableBlock]:
    """The trials that failed, with their reasons."""
    failed = rows[rows["status"] != "ok"]
    if failed.empty:
        return []
    shown = failed.head(FAILURES_SHOWN)
    block = TableBlock.of(Table("failed", shown, _columns(rows, "status", "error")), f"Failed trials ({len(failed):,})")
    rest = len(failed) - len(shown)
    notes = f"trials.parquet has the other {rest:,}." if rest else ""
    return [TableBlock(block.heading, block.headings, block.rows, notes)]


def _columns(rows: pd.DataFrame, *further: str) -> list[Column]:
    """The columns that tell trials apart, and further ones."""
    from studies import metrics
    from studies.experiments.poses import OTHER
    from studies.planning.trial import COLUMNS

    declared = {
        column.name: replace(column, format="d") if column.dtype == "Int64" else column
        for column in (*COLUMNS, *metrics.columns(), OTHER)
    }
    names = ["model", *(["other"] if "other" in rows else [])]
    names += ["category"] if rows["category"].fillna("").nunique() > 1 else []
    names += ["segmenter"] if rows["segmenter"].nunique() > 1 else []
    names += ["part"] if rows["part"].nunique() > 1 and not rows["part"].equals(rows["category"]) else []
    names += ["level"] if rows["level"].nunique() > 1 else []
    names += ["repeat"] if rows["repeat"].nunique() > 1 else []
    return [declared[name] for name in (*names, *further) if name in declared]


def _by_model(rows: pd.DataFrame, numbers: Mapping[str, int]) -> list[TableBlock]:
    """What each model contributes."""
    import pandas as pd

    if rows["model"].nunique() < 2:
        return []
    if VALUE not in rows or rows[VALUE].isna().all():
        return _agreement_by_model(rows, numbers)
    keys = ["model", *(["category"] if rows["category"].fillna("").nunique() > 1 else [])]
    keys += ["segmenter"] if rows["segmenter"].nunique() > 1 else []
    grouped = rows.fillna({"category": ""}).groupby(keys, sort=False)
    frame = grouped.agg(
        mean=(VALUE, "mean"),
        median=(VALUE, "median"),
        largest=(VALUE, "max"),
        n=("status", lambda status: int((status == "ok").sum())),
        failures=("status", lambda status: int((status != "ok").sum())),
    ).reset_index()
    assert isinstance(frame, pd.DataFrame)
    columns = [
        *(Column(name=key, dtype="string") for key in keys),
        Column(name="mean", heading="CP %", format=".2f", help="Mean Change Percentage over its trials."),
        Column(name="median", format=".2f", help="Median over its trials."),
        Column(name="largest", format=".2f", help="Largest of its trials."),
        Column(name="n", heading="trials", format=".0f", help="Trials that succeeded."),
        Column(name="failures", heading="failed", format=".0f", help="Trials that failed."),
    ]
    return [TableBlock.of(Table("by_model", frame, columns), "By model")]


def _agreement_by_model(rows: pd.DataFrame, numbers: Mapping[str, int]) -> list[TableBlock]:
    """How far every method is from people's segmentations of each model, those first on which the first is farthest."""
    if AGAINST_PEOPLE not in rows:
        return []
    good = rows[(rows["status"] == "ok") & rows[AGAINST_PEOPLE].notna()].fillna({"category": ""})
    if good.empty:
        return []
    methods = list(dict.fromkeys(good["segmenter"].astype(str)))
    keys = ["model", *(["category"] if good["category"].nunique() > 1 else [])]
    frame = good.pivot_table(AGAINST_PEOPLE, keys, "segmenter", sort=False).reset_index()
    frame["scene"] = frame["model"].map(_scene_of_model(good, numbers)).fillna(-1).astype(int)
    frame = frame.sort_values(methods[0], ascending=False, kind="stable")
    columns = [
        *(Column(name=key, dtype="string") for key in keys),
        *(Column(name=method, format=".3f", help="Mean over people's segmentations.") for method in methods),
    ]
    block = TableBlock.of(Table("by_model", frame, columns), "By model: Rand Index error")
    linked = [
        [_with_scene(row[0], int(scene)), *row[1:]] for row, scene in zip(block.rows, frame["scene"], strict=True)
    ]
    return [TableBlock(block.heading, block.headings, linked, f"Those come first on which {methods[0]} is farthest.")]


def _scene_of_model(rows: pd.DataFrame, numbers: Mapping[str, int]) -> dict[str, int]:
    shown = rows[rows["trial_id"].isin(numbers)]
    return {str(row.model): numbers[str(row.trial_id)] for row in shown.itertuples()}


def _pictures(results: Results, charts: Mapping[str, Chart]) -> list[PictureBlock]:
    """The pictures of surfaces that a study without a viewer of its own has."""
    skipped = {*charts, GALLERY} if results.experiment.has_scenes else {*charts}
    return [
        PictureBlock.of(path, in_words(path.stem))
        for path in sorted(results.folder.glob("*.png"))
        if path.stem not in skipped and not path.name.startswith(Sweep.PREFIX)
    ]


def claims_table(claims: Sequence[Any], heading: str, notes: str = "") -> TableBlock:
    """Published statements next to computed values."""
    headings = [
        Heading("claim"),
        Heading("paper", "Published value.", True),
        Heading("ours", "Computed value.", True),
        Heading("95 % interval"),
        Heading("verdict", "Same: the published value is in the computed interval."),
    ]
    rows = []
    for claim in claims:
        texts = [plain_text(text) for text in claim.cells()]
        orders = [texts[0], claim.published, claim.computed, claim.low, texts[4]]
        rows.append([Cell(text, "" if is_missing(order) else order) for text, order in zip(texts, orders, strict=True)])
    return TableBlock(heading, headings, rows, notes)
