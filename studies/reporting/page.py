"""results/README.md: every claim of a publication next to the computed value, and every study."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from studies import storage
from studies.reporting.publication import Publication
from studies.reporting.results import CONFIG_FILE, Results
from studies.reporting.text import count_of, markdown_of, markdown_table

HEADINGS = ("section", "claim", "paper", "ours", "95 % interval", "verdict", "study")


def study_folders(results: Path) -> list[Path]:
    """The folders under ``results`` with the rows and the configuration of a study."""
    return [folder for folder in storage.result_folders(results) if (folder / CONFIG_FILE).exists()]


def sorted_by_section(studies: Iterable[Results]) -> list[Results]:
    """Studies in the order of the publication's sections."""
    return sorted(studies, key=lambda study: (_section_number(study), study.folder.as_posix()))


def _section_number(study: Results) -> tuple[bool, str]:
    section = study.publication.section(study.name) if study.publication else ""
    return not section, section  # studies about no section come last


def page(studies: Sequence[Results], root: Path) -> str:
    """The page as Markdown.

    Parameters
    ----------
    studies : sequence of Results
        as `sorted_by_section` returns them
    root : Path
        folder of the page, to which links are relative
    """
    publication = next((study.publication for study in studies if study.publication), None)
    lines = ["# Results", "", *_introduction(publication)]
    if publication:
        lines += ["", *_claims(studies, publication)]
    for study in studies:
        lines += ["", *_study_lines(study, root)]
    return "\n".join(lines) + "\n"


def _introduction(publication: Publication | None) -> list[str]:
    text = (
        "Made by `python -m studies.report` from the trials stored in the folders next to this page; no number was "
        "typed by hand. CP is the Change Percentage: twice the share of points that must change their segment, in "
        "percent. Values are means with their 95 % bootstrap intervals; models are resampled, then repeats."
    )
    if publication:
        text += (
            f" The paper: {publication.citation}. *Same*: the paper's value is in our interval. The paper does not "
            "name its models, and its values too would be different with other models."
        )
    return [text]


def _claims(studies: Sequence[Results], publication: Publication) -> list[str]:
    """The table of claims, and the remarks on those where the computed value is worse."""
    rows: list[list[str]] = []
    remarks: list[str] = []
    texts: set[str] = set()
    for study in studies:
        if study.dataset not in publication.datasets:
            continue
        claims = study.claims()
        section = publication.section(study.name)
        for claim in claims:
            if claim.text in texts:  # Table 2 contains what single studies show again
                continue
            texts.add(claim.text)
            rows.append([section, *claim.cells(), f"[{study.name}](#{_anchor(study)})"])
        remark = publication.remark(study.name)
        if remark and any(claim.verdict == "worse" for claim in claims):
            remarks.append(f"- **{_title(study)}** (section {section}): {remark}")
    lines = markdown_table(HEADINGS, rows)
    return [*lines, "", "Where ours is worse:", "", *remarks] if remarks else lines


def _study_lines(study: Results, root: Path) -> list[str]:
    """One study: what it is, its table, its pictures, and the command that makes them."""
    folder = study.folder.relative_to(root).as_posix()
    lines = [
        f'<a id="{_anchor(study)}"></a>',
        "",
        f"## {_title(study)} ({study.dataset})",
        "",
        _summary_sentence(study),
        "",
        *markdown_of(study.main_table),
        "",
        study.main_table.notes,
        "",
    ]
    for picture in sorted(study.folder.glob("*.png")):
        lines += [f"![{_title(study)}: {picture.stem.replace('_', ' ')}]({folder}/{picture.name})", ""]
    return [*lines, "```", study.command, "```"]


def _summary_sentence(study: Results) -> str:
    section = study.publication.section(study.name) if study.publication else ""
    shows = study.publication.shows(study.name) if study.publication else ""
    where = f"Section {section}{f', {shows}' if shows else ''}. " if section else ""
    failed = f", {study.failures} of which failed" if study.failures else ""
    return f"{where}{count_of(study.rows['model'].nunique(), 'model')}, {count_of(len(study.rows), 'trial')}{failed}."


def _title(study: Results) -> str:
    return study.title.removesuffix(f" on {study.dataset}")


def _anchor(study: Results) -> str:
    return f"{study.name}-{study.dataset}"
