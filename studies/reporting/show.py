"""What a study leaves behind: rows, tables, pictures, and what they were made from."""

import json
import shlex
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import OmegaConf
from rich.table import Table

from studies.execution.engine import TaskFailedError
from studies.statistics import tables
from studies.storage import TABLE_FILE, atomic_write
from studies.storage.provenance import provenance


def write(experiment, cfg, folder, rows, console):
    """Write rows, tables and curves of stored rows to ``folder``, and print the table.

    Parameters
    ----------
    experiment : studies.experiments.Experiment
    cfg : the composed configuration
    folder : Path
    rows : DataFrame of the stored rows, in the order of the plan
    console : rich.console.Console
    """
    from studies.figures import curves as figures

    title = f"{cfg.title} on {rows['dataset'].iloc[0]}"
    with atomic_write(folder / TABLE_FILE) as path:
        rows.to_parquet(path, index=False)
    made = experiment.tables(rows, cfg)
    for stem, table in made.items():
        with atomic_write(folder / f"{stem}.csv") as path:
            table.to_csv(path, index=False, float_format="%.6g")
    table = next(iter(made.values()))
    shown = experiment.display(table)
    with atomic_write(folder / "table.md") as path:
        path.write_text(tables.markdown(title, experiment.headings, shown, experiment.notes))
    for stem, figure in experiment.curves(rows, made, cfg, title).items():
        figures.save(figure, folder / f"{stem}.png")
    console.print(_terminal_table(title, experiment, shown, experiment.narrow(table)))


def write_origin(cfg, folder, trials):
    """Write what was run, and what it was made with and from."""
    said = OmegaConf.create(OmegaConf.to_container(cfg, resolve=True))
    if said.dataset.get("root"):
        # Where the data lie on this machine is nobody else's; what they are, provenance.json says by their digests.
        said.dataset.root = Path(str(said.dataset.root)).name
    with atomic_write(folder / "config.yaml") as path:
        OmegaConf.save(said, path)
    with atomic_write(folder / "provenance.json") as path:
        path.write_text(
            json.dumps(provenance({trial.model.name: trial.mesh_digest for trial in trials}, _command()), indent=2)
            + "\n"
        )


def draw(experiment, cfg, folder, trials, rows, engine, console):
    """Draw the pictures of surfaces that are not there yet. What they show is computed anew, by the engine."""
    from studies.figures import curves as figures

    title = f"{cfg.title} on {rows['dataset'].iloc[0]}"
    for stem, shows, make in experiment.surfaces(trials, rows, cfg, title, engine):
        path = folder / f"{stem}.png"
        if _is_drawn(path, shows):
            continue
        with console.status(f"drawing {path.name}"):
            try:
                figure = make()
            except TaskFailedError as lost:
                console.print(f"no {path.name}: drawing it failed: {lost}", markup=False, soft_wrap=True)
                continue
        figures.save(figure, path, shows)


def _is_drawn(path, shows):
    from PIL import Image

    if not path.exists():
        return False
    with Image.open(path) as image:
        return image.info.get("Shows") == shows


def _terminal_table(title, experiment, rows, narrow):
    """The columns that fit on 80 characters; table.md has them all."""
    padding = (0, 1) if len(narrow) < 8 else (0, 1, 0, 0)
    shown = Table(title=title, caption="table.md says what the columns mean", padding=padding)
    for key in narrow:
        shown.add_column(experiment.headings[key.removesuffix("_alone")], justify="right", no_wrap=True)
    for row in rows:
        shown.add_row(*(row[key] for key in narrow))
    return shown


# Options that say where things are and who works, not what is done.
ELSEWHERE = ("results_dir", "dataset.root", "engine", "trial", "gallery")


def _command():
    """The command that makes these results again; "" where there was none."""
    if not HydraConfig.initialized():
        return ""
    options = HydraConfig.get().overrides.task
    said = [option for option in options if not option.lstrip("+").startswith(ELSEWHERE)]
    return f"python -m studies.run {shlex.join(said)}"
