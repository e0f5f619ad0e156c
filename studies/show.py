"""What a study leaves behind: rows, table, pictures, and what they were made from."""

import json
import platform
import subprocess
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from omegaconf import OmegaConf
from rich.table import Table

import heatwalk
from studies import figures, render, tables
from studies.engine import Lost

CODE = ("../heatwalk", "../perturb", "../studies", "../conf")
PACKAGES = ("numpy", "scipy", "trimesh", "pymeshlab", "fast-simplification", "pandas", "hydra-core")


def write(cfg, folder, title, rows, trials, engine, console):
    """Write rows, table, pictures and what they were made from to ``folder``, and print the table.

    Parameters
    ----------
    cfg : the composed configuration
    folder : Path
    title : str, over the table and the gallery
    rows : DataFrame of the stored rows of ``trials``
    engine : what computes the gallery's segmentations; None for no gallery
    console : rich.console.Console
    """
    rows.to_parquet(folder / "trials.parquet", index=False)
    table = tables.summary(rows, cfg.study.paper)
    table.to_csv(folder / "table.csv", index=False, float_format="%.6g")
    (folder / "table.md").write_text(tables.markdown(table, title))
    OmegaConf.save(cfg, folder / "config.yaml", resolve=True)
    (folder / "provenance.json").write_text(json.dumps(_provenance(trials), indent=2) + "\n")
    figures.curve(table, rows, cfg.study.axis, title, folder / f"{cfg.study.name}.png")
    console.print(_terminal_table(table, title))
    if engine is not None:
        _gallery(cfg, folder, title, rows, trials, engine, console)
    console.print(f"written to {folder}", highlight=False, soft_wrap=True)


def _gallery(cfg, folder, title, rows, trials, engine, console):
    shown = figures.gallery_trials(trials, rows, cfg.gallery.models, cfg.gallery.columns)
    first = {trial.model.name: trial for trial in reversed(shown)}
    tasks = [task for t in shown for task in ([(t, True)] if first[t.model.name] is t else []) + [(t, False)]]
    path = folder / "gallery.png"
    if not tasks or figures.is_drawn(tasks, path):
        return
    with console.status("drawing the gallery"):
        # By the workers: where drawing off screen takes a process down, the study's results stand all the same.
        pictures = dict(engine.run(render.picture, tasks))
    lost = [picture for picture in pictures.values() if isinstance(picture, Lost)]
    if lost:
        console.print(f"no gallery: a process that draws it {lost[0].reason}")
    else:
        figures.gallery({task: pictures[task] for task in tasks}, rows, cfg.study.axis, title, path)


def _terminal_table(table, title):
    """The columns that fit on 80 characters; table.md has them all."""
    unit = " and ".join(table["unit"].unique()).replace("_", " ")
    columns = ("level", "mean", "interval", "median", "paper", "n", "failures")
    shown = Table(title=title, caption=f"CP: Change Percentage. level: {unit}")
    for column in columns:
        shown.add_column(tables.HEADINGS[column], justify="right", no_wrap=True)
    for row in tables.display(table):
        shown.add_row(*(row[column] for column in columns))
    return shown


def _provenance(trials):
    """What the results were made with and from."""
    return {
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": _commit(),
        "version": heatwalk.__version__,
        "algorithm_version": heatwalk.ALGORITHM_VERSION,
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "packages": {name: metadata.version(name) for name in PACKAGES},
        "meshes_sha256": {trial.model.name: trial.mesh for trial in trials},
    }


def _commit():
    """The commit of the checkout that this code runs from, marked when it was changed; None after an install."""

    def git(*words):
        return subprocess.run(
            ["git", *words], cwd=Path(__file__).parent, capture_output=True, text=True, check=True
        ).stdout.strip()

    try:
        tracked = git("ls-files", Path(__file__).name)
        return (
            git("rev-parse", "HEAD") + ("+changes" if git("status", "--porcelain", "--", *CODE) else "")
            if tracked
            else None
        )
    except (OSError, subprocess.CalledProcessError):
        return None
