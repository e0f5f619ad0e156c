"""The files that a study leaves: rows, tables, charts, pictures, and what they were made from."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from studies.execution import TaskFailedError, map_ordered
from studies.execution.interruption import reason
from studies.reporting.latex import latex
from studies.reporting.results import CONFIG_FILE, PROVENANCE_FILE, Results
from studies.reporting.text import markdown_page, print_table
from studies.storage import TABLE_FILE, atomic_write, encodable, write_table
from studies.storage.merging import merge_options
from studies.storage.provenance import MADE_WITH, provenance
from studies.storage.records import read_config, read_provenance

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

    from studies.execution import Engine
    from studies.experiments.experiment import Labels
    from studies.planning.trial import Trial
    from studies.reporting.html.packing import PackedScenes
    from studies.reporting.origin import MadeFrom
    from studies.storage import Place


class DrawingError(RuntimeError):
    """Charts or pictures that could not be drawn; the message says where rows and tables are."""


def write_tables(results: Results, console: Console, *, rows: bool = True) -> None:
    """Write rows, unless ``rows`` is false, and tables; print the main one; draw charts."""
    folder, tables = results.folder, results.report_tables
    if rows:
        write_table(folder / TABLE_FILE, results.rows)
    for name, table in tables.items():
        with atomic_write(folder / f"{name}.csv") as path:
            table.frame.to_csv(path, index=False, float_format="%.6g")
        if table.shortened().visible():
            title = results.title if table is results.main_table else f"{results.title}: {table.title.lower()}"
            with atomic_write(folder / f"{name}.tex") as path:
                path.write_text(encodable(latex(table, title)), "utf-8")
    with atomic_write(folder / "table.md") as path:
        path.write_text(encodable(markdown_page(results.title, *tables.values())), "utf-8")
    for name, text in results.experiment.files(tables, results.rows, results.title).items():
        with atomic_write(folder / name) as path:
            path.write_text(encodable(text), "utf-8")
    print_table(results.title, results.main_table, console)
    from studies.figures import drawing  # takes a second to load: the table is there before

    with _after_tables("charts", results):
        for stem, chart in results.experiment.charts(results.name, tables, results.rows, results.title).items():
            drawing.save(drawing.draw(chart), folder / f"{stem}.png")


def write_origin(made: MadeFrom, place: Place, sources: Sequence[Path], *, ran: bool) -> None:
    """Write what is run, and what it is made with and from.

    Parameters
    ----------
    made : MadeFrom
    place : Place
        the results folder; of a part of what it has, the folder of the part gets its own files
    sources : sequence of Path
        the results folders that rows were taken from
    ran : bool
        whether trials are going to run: otherwise, when and with what the rows were made does not change
    """
    stored = _provenance_of(place.folder)
    earlier = stored or next(filter(None, map(_provenance_of, sources)), {})
    new = provenance(made.origin.meshes, made.command) | made.facts
    if earlier and not ran:
        new |= {key: earlier[key] for key in MADE_WITH if key in earlier}
    if place.is_part:
        if place.part != place.folder:
            place.part.mkdir(parents=True, exist_ok=True)
            _write(place.part, made.origin.record, new)
        if not (ran or place.n_new):
            return
        record = merge_options(_config_of(place.folder) or dict(made.origin.record), dict(made.origin.record))
        versions = dict(stored.get("segmenter_versions", {})) | dict(made.origin.versions)
        new["segmenter_versions"] = versions
        commands = [*stored.get("earlier_commands", ()), stored.get("command", "")]
        new["meshes_sha256"] = dict(stored.get("meshes_sha256", {})) | dict(made.origin.meshes)
        new["earlier_commands"] = [each for each in dict.fromkeys(commands) if each not in ("", made.command)]
        _write(place.folder, record, new)
    elif ran or place.n_new or not stored:
        _write(place.folder, made.origin.record, new)
    elif stored.pop("earlier_commands", None):  # this one makes all that several have made
        _write(place.folder, made.origin.record, stored | {"command": made.command})
    else:
        _write(place.folder, made.origin.record, stored)


def _write(folder: Path, record: Mapping[str, Any], origin: Mapping[str, Any]) -> None:
    import yaml

    with atomic_write(folder / CONFIG_FILE) as path:
        path.write_text(yaml.safe_dump(_encodable(record), sort_keys=False, allow_unicode=True), "utf-8")
    with atomic_write(folder / PROVENANCE_FILE) as path:
        path.write_text(json.dumps(origin, indent=2) + "\n", "utf-8")


def _provenance_of(folder: Path) -> dict[str, Any]:
    """What is stored about the origin of results; nothing if that is missing or damaged."""
    try:
        return read_provenance(folder)
    except (OSError, ValueError):
        return {}


def _config_of(folder: Path) -> dict[str, Any]:
    """The configuration that is stored with results; nothing if there is none."""
    return read_config(folder) if (folder / CONFIG_FILE).exists() else {}


def _encodable(value: Any) -> Any:
    """A configuration whose text can be written to any file."""
    if isinstance(value, str):
        return encodable(value)
    if isinstance(value, Mapping):
        return {_encodable(key): _encodable(each) for key, each in value.items()}
    return [_encodable(each) for each in value] if isinstance(value, list) else value


def draw_pictures(results: Results, trials: Sequence[Trial], labels: Labels, engine: Engine, console: Console) -> None:
    """Draw the pictures of surfaces that do not exist yet. Workers compute what they show."""
    from studies.figures import drawing
    from studies.figures.pictures import is_drawn

    with _after_tables("pictures", results):
        for picture in results.experiment.pictures(results.name, trials, results.rows, results.title, labels):
            path = results.folder / f"{picture.stem}.png"
            if is_drawn(path, picture.content):
                continue
            with console.status(f"drawing {path.name}"):
                try:
                    figure = picture.figure(map_ordered(engine, picture.function, picture.tasks()))
                except TaskFailedError as error:
                    console.print(f"{path.name} was not drawn: {error}", markup=False, soft_wrap=True)
                    continue
            drawing.save(figure, path, picture.content)


def make_scenes(
    results: Results, trials: Sequence[Trial], labels: Labels, engine: Engine, console: Console
) -> PackedScenes | None:
    """The scenes of the page's viewer, which workers make; those of the page that is there if they show the same."""
    from studies.reporting.html.packing import pack
    from studies.reporting.html.page import REPORT_FILE, stored_scenes

    with _after_tables("scenes", results):
        made_from = results.experiment.scenes(trials, results.rows, labels)
        if made_from is None:
            return None
        stored = stored_scenes(results.folder / REPORT_FILE)
        if stored is not None and stored.content == made_from.content:
            return stored
        with console.status(f"making {REPORT_FILE}"):
            try:
                scenes = map_ordered(engine, made_from.function, made_from.tasks())
            except TaskFailedError as error:
                console.print(f"{REPORT_FILE} has no viewer: {error}", markup=False, soft_wrap=True)
                return None
        together = [scene for of_task in scenes for scene in of_task]
        return pack(together, slider=made_from.slider, content=made_from.content)


@contextmanager
def _after_tables(what: str, results: Results) -> Iterator[None]:
    """Say, of an error in drawing, that rows and tables are written."""
    try:
        yield
    except OSError:  # such as a full disk, of which the message says enough
        raise
    except Exception as error:
        raise DrawingError(
            f"the {what} of {type(results.experiment).__name__} failed with {reason(error)}; rows and tables are "
            f"written to {results.folder}"
        ) from error
