"""The page that leads to those of all studies: what a publication claims, and a card for each study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from studies.reporting.html.page import (
    INDEX_FILE,
    REPORT_FILE,
    Block,
    Card,
    CardsBlock,
    Cell,
    Page,
    TableBlock,
    Text,
    picture_source,
)
from studies.reporting.html.study_page import claims_table
from studies.reporting.page import boards_first, headings_of, introduction, picture_of
from studies.reporting.text import count_of, plain_text
from studies.storage.folders import PLATES_FILE

if TYPE_CHECKING:
    from studies.reporting.claims import Claim
    from studies.reporting.results import Results

THUMBNAIL = 480  # pixels across


def index_page(studies: Sequence[Results], root: Path) -> Page:
    """The page of all results.

    Parameters
    ----------
    studies : sequence of Results
        as `studies.reporting.page.sorted_by_section` returns them
    root : Path
        folder of the page, to which links are relative
    """
    publication = next((study.publication for study in studies if study.publication), None)
    lines = [plain_text(line) for line in introduction(publication, root)[:1]]
    headings = headings_of(studies, root)
    trials = sum(len(study.rows) for study in studies)
    lead = f"{count_of(len(studies), 'study', 'studies')}, {count_of(trials, 'trial')}"
    blocks: list[Block] = [
        Text("", lines),
        *_plates(root),
        CardsBlock("Studies", [_card(study, headings[study.folder], root) for study in boards_first(studies)]),
        *_claims(studies, root),
    ]
    return Page("Results", blocks, lead)


def write_index(studies: Sequence[Results], root: Path) -> None:
    """Write the page of all results."""
    index_page(studies, root).write(root / INDEX_FILE)


def link_to(study: Results, root: Path) -> str:
    """The address of a study's page, relative to the folder of all results."""
    return quote((study.folder.relative_to(root) / REPORT_FILE).as_posix())


def _plates(root: Path) -> list[Block]:
    """The way to the interactive plates, if they have been made."""
    if not (root / PLATES_FILE).exists():
        return []
    text = "Figures 1 to 15: heat from the vertex that is clicked, the steps of the walk, poses and variants."
    return [CardsBlock("", [Card("The paper's figures as interactive plates", PLATES_FILE, text)])]


def _card(study: Results, heading: str, root: Path) -> Card:
    section = study.publication.section(study.name, study.rows) if study.publication else ""
    failed = f", {study.failures:,} failed" if study.failures else ""
    facts = [
        f"section {section}" if section else "",
        study.subset or count_of(len(study.models), "model"),
        f"{count_of(len(study.rows), 'trial')}{failed}",
    ]
    return Card(heading, link_to(study, root), "; ".join(filter(None, facts)), _thumbnail(study))


def _thumbnail(study: Results) -> str:
    picture = picture_of(study)
    return picture_source(picture, THUMBNAIL) if picture else ""


def _claims(studies: Sequence[Results], root: Path) -> list[TableBlock]:
    """Every claim of a publication next to the computed value, once."""
    claims: list[Claim] = []
    links: list[str] = []
    for study in studies:
        if study.publication is None or study.dataset not in study.publication.datasets:
            continue
        for claim in study.claims():
            if claim.text not in {each.text for each in claims}:
                claims.append(claim)
                links.append(link_to(study, root))
    if not claims:
        return []
    block = claims_table(claims, "What the paper claims")
    linked = [[Cell(row[0].text, row[0].order, link), *row[1:]] for row, link in zip(block.rows, links, strict=True)]
    return [TableBlock(block.heading, block.headings, linked)]
