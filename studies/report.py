"""``python -m studies.report [RESULTS]``: tables, curves and the page of the paper's claims, from stored rows alone.

Nothing is computed anew: every figure on the page comes from the trials that lie under RESULTS.
"""

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path

import hydra.utils
import pandas as pd
from omegaconf import OmegaConf

from studies.planning.trial import columns_of
from studies.storage import atomic_write, read_rows, result_folders

# What the paper's own experiments were made on; its claims are compared with no others.
PAPERS_DATASETS = ("psb", "tosca")


@dataclass(frozen=True)
class Stored:
    """A study's results: its folder, its configuration, its rows, its kind, and the command that made it."""

    folder: Path
    cfg: object
    rows: pd.DataFrame
    experiment: object
    command: str

    @classmethod
    def load(cls, folder):
        cfg = OmegaConf.load(folder / "config.yaml")
        if "experiment" not in cfg or "section" not in cfg.study:
            raise ValueError(f"{folder} holds the results of an earlier version: run its study again, or move it away")
        experiment = hydra.utils.instantiate(cfg.experiment)
        command = json.loads((folder / "provenance.json").read_text())["command"]
        return cls(folder, cfg, read_rows(folder, columns_of(experiment)), experiment, command)


def stored(results):
    """Every study under ``results`` that has rows, in the order of the paper's sections."""
    found = [Stored.load(folder) for folder in result_folders(results) if (folder / "config.yaml").exists()]
    return sorted(
        (study for study in found if not study.rows.empty),
        key=lambda study: (str(study.cfg.study.section), study.folder.as_posix()),
    )


def page(studies, results):
    """results/README.md: every claim of the paper's section 6 beside our figure, and every study below.

    studies : list of Stored
    results : Path that links are relative to

    Returns
    -------
    str
    """
    from studies.statistics import tables

    lines = [
        "# The paper's section 6, made again",
        "",
        "Made by `python -m studies.report` from the trials stored in the folders beside this page; no figure is "
        "typed. The paper: Benjamin, Polk, Vishwanathan, Ramani, *Heat Walk: Robust Salient Segmentation of Non-rigid"
        " Shapes*, 2011. CP is the Change Percentage: twice the share of points that must change their segment, in "
        "percent. Ours: the mean and its 95 % bootstrap interval, models resampled, then repeats. *Same*: the paper's"
        " figure lies in our interval. The paper does not name its models, so that even its own figures would move "
        "with other ones.",
        "",
    ]
    papers = [study for study in studies if study.rows["dataset"].iloc[0] in PAPERS_DATASETS]
    headings = ("section", "claim", "paper", "ours", "95 % interval", "verdict", "study")
    lines += ["| " + " | ".join(headings) + " |", "|" + " --- |" * len(headings)]
    remarks, said = [], set()
    for study in papers:
        made = study.experiment.tables(study.rows, study.cfg)
        claims = study.experiment.claims(made, study.cfg)
        for claim in claims:
            if claim.what in said:  # Table 2 holds what studies of their own show again
                continue
            said.add(claim.what)
            cells = (
                str(study.cfg.study.section),
                claim.what,
                tables.number(claim.paper, claim.digits) + (claim.unit if not pd.isna(claim.paper) else ""),
                tables.number(claim.ours, claim.digits) + claim.unit,
                tables.interval_text(claim.low, claim.high, claim.digits),
                f"**{claim.verdict}**" if claim.verdict == "worse" else claim.verdict,
                f"[{study.cfg.study.name}](#{_anchor(study)})",
            )
            lines.append("| " + " | ".join(cells) + " |")
        if study.cfg.study.get("remark") and any(claim.verdict == "worse" for claim in claims):
            remarks.append(f"- **{study.cfg.title}** (section {study.cfg.study.section}): {study.cfg.study.remark}")
    if remarks:
        lines += ["", "Where ours is worse:", "", *remarks]
    for study in studies:
        lines += ["", *_section(study, results)]
    return "\n".join(lines) + "\n"


def _section(study, results):
    """One study: what it is, its table, its pictures, and the command that makes them."""

    cfg, rows = study.cfg, study.rows
    table = next(iter(study.experiment.tables(rows, cfg).values()))
    shown = study.experiment.display(table)
    n_models, failed = rows["model"].nunique(), int((rows["status"] != "ok").sum())
    folder = study.folder.relative_to(results).as_posix()
    lines = [
        f'<a id="{_anchor(study)}"></a>',
        "",
        f"## {cfg.title} ({study.rows['dataset'].iloc[0]})",
        "",
        f"Section {cfg.study.section}{', ' + cfg.study.shows if cfg.study.get('shows') else ''}. "
        f"{n_models} models, {len(rows)} trials{f', {failed} of which failed' if failed else ''}.",
        "",
        "| " + " | ".join(study.experiment.headings.values()) + " |",
        "|" + " --- |" * len(study.experiment.headings),
        *("| " + " | ".join(row[key] for key in study.experiment.headings) + " |" for row in shown),
        "",
        study.experiment.notes,
        "",
    ]
    for picture in sorted(study.folder.glob("*.png")):
        lines += [f"![{cfg.title}: {picture.stem.replace('_', ' ')}]({folder}/{picture.name})", ""]
    return [*lines, "```", study.command, "```"]


def _anchor(study):
    return f"{study.cfg.study.name}-{study.rows['dataset'].iloc[0]}"


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="studies.report", description=__doc__.split("\n\n")[0])
    parser.add_argument("results", nargs="?", type=Path, default=Path("results"), help="folder (default: results)")
    results = parser.parse_args(arguments).results

    from rich.console import Console

    from studies.reporting import show

    try:
        found = stored(results)
        if not found:
            raise ValueError(f"there are no rows of a study under {results}")
    except ValueError as error:
        print(f"studies.report: error: {error}", file=sys.stderr)
        return 2
    console = Console()
    for study in found:
        show.write(study.experiment, study.cfg, study.folder, study.rows, console)
    with atomic_write(results / "README.md") as path:
        path.write_text(page(found, results))
    console.print(f"{len(found)} studies; the page is {results / 'README.md'}", highlight=False, soft_wrap=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
