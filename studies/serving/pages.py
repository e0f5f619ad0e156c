"""The pages that the server makes: the index of all studies, and the page of one that has no report yet."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import timedelta
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.columns import MISSING, Column
from studies.planning.trial import COLUMNS
from studies.serving.current_table import CurrentTable
from studies.serving.site import Site
from studies.serving.watching import FolderWatch
from studies.storage import encodable
from studies.storage.folders import INDEX_FILE, REPORT_FILE
from studies.terminal import one_line

if TYPE_CHECKING:
    from jinja2 import Environment

LIVE = "/-/live"  # before the address of a folder: its live page, even if it has a report

_SHOWN = ("model", "segmenter", "part", "level", "repeat", "seconds_segment", "status")  # of the newest rows
_FAILED = ("model", "segmenter", "part", "level", "repeat", "status", "error")
_FORMATS = {"seconds_segment": ".2f"}
_PICTURES, _PAGES = (".png",), (".html", ".md", ".csv", ".tex", ".pdf", ".yaml", ".json")


@dataclass(frozen=True)
class Entry:
    """What pages say about a results folder.

    Parameters
    ----------
    name, title : str
        the folder, and the study, "" if its configuration cannot be read
    report, live : str
        addresses of its report, "" if there is none, and of its live page
    problem : str
        why it cannot be read
    running : bool
    state : str
        see `FolderSummary.state`
    planned, done, failed : int
        numbers of trials
    kinds : mapping of str to int
        how many ended otherwise than well, by status
    left, written : str
        the time left, and when something was last written
    """

    name: str
    title: str
    report: str
    live: str
    problem: str = ""
    running: bool = False
    state: str = ""
    planned: int = 0
    done: int = 0
    failed: int = 0
    kinds: Mapping[str, int] = field(default_factory=dict)
    left: str = ""
    written: str = ""


class Pages:
    """Makes the pages.

    Parameters
    ----------
    site : Site
    """

    def __init__(self, site: Site) -> None:
        self._site = site

    def index(self, watches: list[FolderWatch]) -> str:
        """The page of all studies, those that run first."""
        entries = sorted((self._entry(watch) for watch in watches), key=lambda entry: not entry.running)
        has_index = (self._site.root / INDEX_FILE).is_file()
        return _render(
            "index.html", title=_text(self._site.root), entries=entries, index=f"/{INDEX_FILE}" if has_index else ""
        )

    def study(self, watch: FolderWatch, current: CurrentTable | None) -> str:
        """The page of one study as it is now.

        Parameters
        ----------
        watch : FolderWatch
        current : CurrentTable or None
            None while the first one is being made
        """
        return _render(
            "study.html",
            entry=self._entry(watch),
            current=current,
            latest=_rows(watch.latest, _SHOWN),
            failures=_rows(watch.failures, _FAILED),
            files=self._files(watch.folder, _PAGES),
            pictures=self._files(watch.folder, _PICTURES),
        )

    def _entry(self, watch: FolderWatch) -> Entry:
        """What the index says about a results folder."""
        folder = self._site.href(watch.folder)
        entry = Entry(
            name=_text(watch.folder.relative_to(self._site.root)),
            title=encodable(watch.title()),
            report=f"{folder}/{REPORT_FILE}" if (watch.folder / REPORT_FILE).is_file() else "",
            live=f"{LIVE}{folder}/",
        )
        try:
            summary = watch.summary()
        except Exception as error:  # whatever a file leads to that a study did not write
            return replace(entry, problem=encodable(f"cannot be read: {one_line(error)}"))
        running = summary.holder is not None
        return replace(
            entry,
            running=running,
            state=encodable(summary.state),
            planned=summary.n_planned,
            done=summary.statuses.total(),
            failed=summary.statuses.total() - summary.statuses["ok"],
            kinds={kind: n for kind, n in sorted(summary.statuses.items()) if kind != "ok"},
            left=duration(watch.seconds_left()) if running and summary.n_missing > 0 else "",
            written=summary.written.isoformat(" ", "seconds"),
        )

    def _files(self, folder: Path, suffixes: tuple[str, ...]) -> list[dict[str, str]]:
        """Name and address of the files of a folder that end so."""
        found = sorted(path for path in folder.iterdir() if path.suffix in suffixes and path.is_file())
        return [{"name": encodable(path.name), "href": self._site.href(path)} for path in found]


def _text(path: Path) -> str:
    return encodable(path.as_posix())


def duration(seconds: float | None) -> str:
    """A time in words.

    Examples
    --------
    >>> duration(3725.4), duration(0.2), duration(None)
    ('1:02:05', 'under a second', '–')
    """
    if seconds is None:
        return MISSING
    return str(timedelta(seconds=round(seconds))) if seconds >= 1 else "under a second"


def _rows(rows: Sequence[dict[str, Any]], names: tuple[str, ...]) -> dict[str, Any]:
    """Rows as a table: headings, and cells with the newest first."""
    declared = {column.name: column for column in COLUMNS}
    columns = [replace(declared[name], format=_FORMATS.get(name, declared[name].format)) for name in names]
    return {
        "headings": [column.title for column in columns],
        "cells": [[_cell(column, row) for column in columns] for row in reversed(rows)],
    }


def _cell(column: Column, row: dict[str, Any]) -> str:
    """A value as text, whatever it is: a row may be of another version."""
    try:
        return column.text(row)
    except (ValueError, TypeError):
        return str(row.get(column.name))


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    assets = Path(__file__).with_name("assets")
    return Environment(loader=FileSystemLoader(assets), autoescape=True, undefined=StrictUndefined, trim_blocks=True)


def _render(template: str, **values: Any) -> str:
    return _environment().get_template(template).render(**values)


def digest_of(text: str) -> str:
    """What tells browsers whether a page has changed."""
    return f'"{hashlib.sha256(text.encode()).hexdigest()[:32]}"'
