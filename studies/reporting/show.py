"""What a study leaves behind: rows, tables, pictures, and what they were made from."""

import json
import platform
import shlex
import subprocess
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import OmegaConf
from rich.table import Table

import heatwalk
from studies.execution.engine import LostError
from studies.statistics import tables
from studies.storage.store import TABLE, replacing

CODE = ("../../heatwalk", "../../perturb", "../../studies", "../../conf")
PACKAGES = ("numpy", "scipy", "trimesh", "pymeshlab", "fast-simplification", "pandas", "hydra-core")


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
    with replacing(folder / TABLE) as path:
        rows.to_parquet(path, index=False)
    made = experiment.tables(rows, cfg)
    for stem, table in made.items():
        with replacing(folder / f"{stem}.csv") as path:
            table.to_csv(path, index=False, float_format="%.6g")
    table = next(iter(made.values()))
    shown = experiment.display(table)
    with replacing(folder / "table.md") as path:
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
    with replacing(folder / "config.yaml") as path:
        OmegaConf.save(said, path)
    with replacing(folder / "provenance.json") as path:
        path.write_text(json.dumps(_provenance(trials), indent=2) + "\n")


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
            except LostError as lost:
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


def _provenance(trials):
    """What the results were made with and from."""
    return {
        "command": _command(),
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": _commit(),
        "version": heatwalk.__version__,
        "algorithm_version": heatwalk.ALGORITHM_VERSION,
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "packages": {name: metadata.version(name) for name in PACKAGES},
        "meshes_sha256": {trial.model.name: trial.mesh for trial in trials},
    }


# Options that say where things are and who works, not what is done.
ELSEWHERE = ("results_dir", "dataset.root", "engine", "trial", "gallery")


def _command():
    """The command that makes these results again; "" where there was none."""
    if not HydraConfig.initialized():
        return ""
    options = HydraConfig.get().overrides.task
    said = [option for option in options if not option.lstrip("+").startswith(ELSEWHERE)]
    return f"python -m studies.run {shlex.join(said)}"


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
