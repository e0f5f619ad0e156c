"""The files that a study leaves: rows, tables, charts, pictures, and what they were made from."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from studies.execution import TaskFailedError, map_ordered
from studies.reporting.results import CONFIG_FILE, PROVENANCE_FILE, Results
from studies.reporting.text import markdown_page, print_table
from studies.storage import TABLE_FILE, LabelStore, atomic_write, encodable
from studies.storage.provenance import provenance

if TYPE_CHECKING:
    from rich.console import Console

    from studies.execution import Engine
    from studies.planning.configuration import Study
    from studies.planning.trial import Trial


def write_tables(results: Results, console: Console) -> None:
    """Write rows, tables and charts to the folder of the results, and print the main table."""
    from studies.figures import drawing

    folder, tables = results.folder, results.report_tables
    with atomic_write(folder / TABLE_FILE) as path:
        results.rows.to_parquet(path, index=False)
    for name, table in tables.items():
        with atomic_write(folder / f"{name}.csv") as path:
            table.frame.to_csv(path, index=False, float_format="%.6g")
    with atomic_write(folder / "table.md") as path:
        path.write_text(encodable(markdown_page(results.title, *tables.values())), "utf-8")
    for stem, chart in results.experiment.charts(results.name, tables, results.rows, results.title).items():
        drawing.save(drawing.draw(chart), folder / f"{stem}.png")
    print_table(results.title, results.main_table, console)


def write_origin(study: Study, trials: Sequence[Trial]) -> None:
    """Write what is run, and what it is made with and from."""
    import yaml

    with atomic_write(study.folder / CONFIG_FILE) as path:
        path.write_text(yaml.safe_dump(_encodable(study.record), sort_keys=False, allow_unicode=True), "utf-8")
    meshes = {encodable(trial.model.name): trial.mesh_digest for trial in trials}
    with atomic_write(study.folder / PROVENANCE_FILE) as path:
        path.write_text(json.dumps(provenance(meshes, study.command), indent=2) + "\n", "utf-8")


def _encodable(value: Any) -> Any:
    """A configuration whose text can be written to any file."""
    if isinstance(value, str):
        return encodable(value)
    if isinstance(value, Mapping):
        return {_encodable(key): _encodable(each) for key, each in value.items()}
    return [_encodable(each) for each in value] if isinstance(value, list) else value


def draw_pictures(results: Results, trials: Sequence[Trial], engine: Engine, console: Console) -> None:
    """Draw the pictures of surfaces that do not exist yet. Workers compute what they show."""
    from studies.figures import drawing
    from studies.figures.pictures import is_drawn

    labels = LabelStore(results.folder).get
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
