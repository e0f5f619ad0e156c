"""results/README.md: every claim of a publication next to the computed value, and every study."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from studies import storage
from studies.columns import MISSING
from studies.planning.titles import full_title
from studies.reporting.publication import Publication
from studies.reporting.results import CONFIG_FILE, Results
from studies.reporting.sweeps import Sweep
from studies.reporting.text import count_of, in_words, markdown_of, markdown_table
from studies.storage.folders import PUBLISHED_FILE, REPORT_FILE
from studies.storage.identity import short_digest

HEADINGS = ("section", "claim", "paper", "ours", "95 % interval", "verdict", "study")
MOST_NAMED_MODELS = 12  # whose names are all on the page
MOST_RANGES = 20  # of models whose names are numbers
LONGEST_TABLE = 60  # rows of a table that is not folded


def study_folders(results: Path) -> list[Path]:
    """The folders under ``results`` with the rows and the configuration of a study."""
    return [folder for folder in storage.result_folders(results) if (folder / CONFIG_FILE).exists()]


def sorted_by_section(studies: Iterable[Results]) -> list[Results]:
    """Studies in the order of the publication's sections, without those that are a part of another."""
    studies = list(studies)
    rows = {study.folder: set(study.rows["trial_id"]) for study in studies}
    whole = [
        study
        for study in studies
        if not any(rows[study.folder] <= rows[above] for above in study.folder.parents if above in rows)
    ]
    sections: dict[str, str] = {}  # of a study, whatever method it is with: the studies of a sweep stay together
    for study in whole:
        section = study.publication.section(study.name, study.rows) if study.publication else ""
        sections[study.name] = section or sections.get(study.name, "")
    # Studies about no section come last.
    return sorted(whole, key=lambda study: (not sections[study.name], sections[study.name], study.folder.as_posix()))


def page(studies: Sequence[Results], root: Path, sweeps: Sequence[Sweep] = ()) -> str:
    """The page as Markdown.

    Parameters
    ----------
    studies : sequence of Results
        as `sorted_by_section` returns them
    root : Path
        folder of the page, to which links are relative
    sweeps : sequence of Sweep
        the sweeps that some of the studies belong to
    """
    publication = next((study.publication for study in studies if study.publication), None)
    lines = ["# Results", "", *introduction(publication, root)]
    if publication:
        lines += ["", *_claims(studies, publication, root)]
    headings = headings_of(studies, root)
    told: dict[str, Results] = {}
    shown: set[Path] = set()
    for study in boards_first(studies):
        for sweep in sweeps:
            if study.folder in sweep.folders and sweep.file("") not in shown:
                shown.add(sweep.file(""))
                lines += ["", *_sweep_lines(sweep, root)]
        lines += ["", *_study_lines(study, root, headings[study.folder], publication, told)]
    return "\n".join([*lines, *_notes(studies, root)]) + "\n"


def boards_first(studies: Iterable[Results]) -> list[Results]:
    """The studies with those of all methods first, which most readers look for, then those of variants of one."""

    def place(study: Results) -> int:
        if not study.experiment.gathers:
            return 2
        return int(bool(getattr(study.experiment, "paired_with", None)))

    return sorted(studies, key=place)


def introduction(publication: Publication | None, root: Path) -> list[str]:
    """How the page is made and read, as lines of Markdown."""
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
    lines = [text]
    if (root / PUBLISHED_FILE).is_file():
        lines += ["", (root / PUBLISHED_FILE).read_text("utf-8").strip()]
    return lines


def _claims(studies: Sequence[Results], publication: Publication, root: Path) -> list[str]:
    """The table of claims, and the remarks on those where the computed value is worse."""
    rows: list[list[str]] = []
    remarks: list[str] = []
    texts: set[str] = set()
    for study in studies:
        if study.dataset not in publication.datasets:
            continue
        claims = study.claims()
        section = publication.section(study.name, study.rows)
        for claim in claims:
            if claim.text in texts:  # Table 2 contains what single studies show again
                continue
            texts.add(claim.text)
            rows.append([section, *claim.cells(), f"[{study.name}](#{_anchor(study.folder, root)})"])
        remark = publication.remark(study.name, study.rows)
        if remark and any(claim.verdict == "worse" for claim in claims):
            remarks.append(f"- **{study.base_title}** (section {section}): {remark}")
    lines = [_verdicts(rows), "", *markdown_table(HEADINGS, rows)] if rows else []
    return [*lines, "", "Where ours is worse:", "", *remarks] if remarks else lines


def _verdicts(rows: Sequence[Sequence[str]]) -> str:
    """How many of the published values are the same, better or worse."""
    verdicts = Counter(row[HEADINGS.index("verdict")].strip("*") for row in rows)
    verdicts.pop(MISSING, None)
    named = [f"{n} {verdict}" for verdict, n in verdicts.most_common()]
    return f"Of {count_of(verdicts.total(), 'published value')}: {', '.join(named)}." if named else ""


def _study_lines(
    study: Results, root: Path, heading: str, publication: Publication | None, told: dict[str, Results]
) -> list[str]:
    """One study: what it is and amounts to, its table, one picture, and where the rest is.

    ``told`` has the models that the page names, and the first study of each of them.
    """
    folder = study.folder.relative_to(root).as_posix()
    findings = study.experiment.findings(study.rows, publication.argument if publication else None)
    picture = picture_of(study)
    return [
        f'<a id="{_anchor(study.folder, root)}"></a>',
        "",
        f"## {heading}",
        "",
        f"{_summary(study, root, told)} {_link(study, folder)}",
        "",
        *([findings, ""] if findings else []),
        *_folded(markdown_of(study.main_table.shortened())),
        "",
        *([f"![{heading}: {in_words(picture.stem)}](<{folder}/{picture.name}>)", ""] if picture else []),
        "  \n".join(f"`{command}`" for command in (*study.earlier_commands, study.command) if command),
    ]


def _folded(table: list[str]) -> list[str]:
    """Lines of a table, folded if it is long."""
    n_rows = len(table) - 2
    if n_rows <= LONGEST_TABLE:
        return table
    return ["<details>", f"<summary>Table of {n_rows} rows</summary>", "", *table, "", "</details>"]


def _link(study: Results, folder: str) -> str:
    """Where everything about a study is."""
    has_report = (study.folder / REPORT_FILE).is_file()
    return f"[Report](<{folder}/{REPORT_FILE}>)." if has_report else f"[All tables](<{folder}/table.md>)."


def picture_of(study: Results) -> Path | None:
    """The picture that stands for a study: the one that its kind of experiment names, its own chart, or any."""
    found = {path.stem: path for path in sorted(study.folder.glob("*.png")) if not path.stem.startswith(Sweep.PREFIX)}
    return found.get(study.experiment.picture) or found.get(study.name) or next(iter(found.values()), None)


def _notes(studies: Sequence[Results], root: Path) -> list[str]:
    """What the tables show, once for all studies of a kind."""
    studies_of: dict[str, list[str]] = {}
    for study in studies:
        if study.main_table.notes:
            link = f"[{study.base_title}](#{_anchor(study.folder, root)})"
            studies_of.setdefault(study.main_table.notes, []).append(link)
    if not studies_of:
        return []
    return ["", "**Notes**", "", *(f"- {', '.join(links)}. {notes}" for notes, links in studies_of.items())]


def _sweep_lines(sweep: Sweep, root: Path) -> list[str]:
    """What a sweep found: the tables of its studies as one, and a curve."""
    folder = sweep.folder.relative_to(root).as_posix()
    heading = f"{sweep.title}, by {' and '.join(sweep.options)}"
    lines = [
        f'<a id="{_anchor(sweep.file(""), root)}"></a>',
        "",
        f"## {heading}",
        "",
        *markdown_of(sweep.table),
        "",
    ]
    picture = sweep.file(".png")
    return [*lines, *([f"![{heading}](<{folder}/{picture.name}>)", ""] if picture.exists() else [])]


def headings_of(studies: Sequence[Results], root: Path) -> dict[Path, str]:
    """The heading of each study, with the name of its folder where another study has the same."""
    headings = {study.folder: _heading(study) for study in studies}
    for study in studies:
        heading = headings[study.folder]
        if sum(heading == other for other in headings.values()) > 1 or _own_options(study, root):
            headings[study.folder] = (
                f"{heading}; {_own_options(study, root) or study.folder.relative_to(root).as_posix()}"
            )
    return headings


def _heading(study: Results) -> str:
    """The title of a study with its dataset in parentheses."""
    title = f"{study.base_title} ({study.dataset})"
    return f"{title}: {study.extent}" if study.extent else full_title(title, "", study.methods, study.subset)


def _own_options(study: Results, root: Path) -> str:
    """The options that the folder of a study is named after, but for those of the method, which the title has."""
    folders = study.folder.relative_to(root).parts[2:]
    return ", ".join(name for name in folders if not name.startswith("segmenter"))


def _summary(study: Results, root: Path, told: dict[str, Results]) -> str:
    """What the study is, of how many models, and which, unless an earlier one is about the same."""
    section = study.publication.section(study.name, study.rows) if study.publication else ""
    shows = study.publication.shows(study.name, study.rows) if study.publication else ""
    where = f"Section {section}{f', {shows}' if shows else ''}. " if section else _perturbations(study)
    failed = f", {study.failures:,} of which failed" if study.failures else ""
    models = _models(study)
    first = told.setdefault(models, study)
    if first is not study:
        models = f"The models of [{first.base_title}](#{_anchor(first.folder, root)});"
    return f"{where}{models} {count_of(len(study.rows), 'trial')}{failed}."


def _perturbations(study: Results) -> str:
    """The perturbations of a study that no section of a publication is about."""
    names = [str(name).replace("_", " ") for name in study.rows["perturbation"].dropna().unique() if name]
    return f"Perturbation: {', '.join(names)}. " if names else ""


def _models(study: Results) -> str:
    """Which models of how many."""
    names = study.models
    number = study.subset or count_of(len(names), "model")
    dataset = study.record.get("dataset", {})
    categories = dataset.get("categories")
    if isinstance(categories, list):
        categories = ", ".join(map(str, categories))
    of = f" in the categories {str(categories).replace('_', ' ')}" if categories and study.subset else ""
    source = f" of {dataset['root']}" if dataset.get("root") else ""
    return f"{number}{of}{source}: {_named(names)};"


def _named(names: Sequence[str]) -> str:
    """Names of models; numbers as ranges."""
    if all(name.isdecimal() for name in names):
        numbers = sorted(map(int, names))
        starts = [n for i, n in enumerate(numbers) if i == 0 or numbers[i - 1] != n - 1]
        ends = [n for i, n in enumerate(numbers) if i == len(numbers) - 1 or numbers[i + 1] != n + 1]
        names = [f"{a}–{b}" if a < b else f"{a}" for a, b in zip(starts, ends, strict=True)]
        most = MOST_RANGES
    else:
        most = MOST_NAMED_MODELS
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[: most - 2])} … {names[-1]}"


def _anchor(path: Path, root: Path) -> str:
    """The anchor of a section, one per folder."""
    plain = path.relative_to(root).as_posix().replace("/", "-")
    anchor = re.sub(r"[^\w.=-]+", "-", plain)
    return anchor if anchor == plain else f"{anchor}-{short_digest(plain)}"
