"""Pages of studies that run: every answer shows the rows that were stored before it was asked for."""

import shutil
import time
from html.parser import HTMLParser
from pathlib import Path

import pandas as pd
import pytest
import yaml

from studies.reporting.results import Results
from studies.serving import current_table, watching
from studies.storage import RowStore, encodable
from tests.studies.storage.example_rows import row

SOURCE = Path(__file__).parents[3] / "results" / "shot_noise" / "bundled"


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    """Folders are looked for, and tables made, whenever a page is asked for."""
    monkeypatch.setattr(watching, "WALK_SECONDS", 0)
    monkeypatch.setattr(current_table, "REST", 0)


class Parsed(HTMLParser):
    """The elements of a page, and its tables as texts."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.tables, self.text, self._cell = [], {}, "", None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag == "table":
            self._table = self.tables.setdefault(dict(attrs).get("class", f"table {len(self.tables)}"), [])
        elif tag == "tr":
            self._table.append([])
        elif tag in ("td", "th"):
            self._table[-1].append("")
            self._cell = True

    def handle_endtag(self, tag):
        if tag in ("td", "th"):
            self._table[-1][-1] = " ".join(self._table[-1][-1].split())
            self._cell = None

    def handle_data(self, data):
        self.text += data
        if self._cell:
            self._table[-1][-1] += data

    def words(self):
        return " ".join(self.text.split())


@pytest.fixture
def real(served):
    """A folder for the rows of a study that was run, and these rows as they are stored."""
    folder = served.root / "shot_noise" / "bundled"
    folder.mkdir(parents=True)
    shutil.copy(SOURCE / "config.yaml", folder)
    rows = pd.read_parquet(SOURCE / "trials.parquet").astype(object)
    yield folder, rows.where(rows.notna(), None).to_dict("records")
    shutil.rmtree(folder.parent)


def until(served, path, wanted):
    """The page as soon as it contains some text: its table is made beside the server."""
    for _ in range(600):
        page = Parsed(served.text(path))
        if wanted in page.words():
            return page
        time.sleep(0.1)
    raise AssertionError(f"{wanted!r} is not in {page.words()}")


def test_rows_are_on_both_pages_as_soon_as_they_are_stored(served, real):
    folder, rows = real
    with RowStore(folder) as store:
        store.write_plan([each["trial_id"] for each in rows])
        stored = 0
        for added in (1, 2, 7):
            store.add(*rows[stored : stored + added])
            stored += added
            index = Parsed(served.text("/"))
            (line,) = [cells for cells in index.tables["studies"] if "shot_noise/bundled" in cells[0]]
            assert line[1] == f"{stored} of 45"
            assert line[3].startswith("running: process ")
            assert f"{stored} of 45" in Parsed(served.text("/shot_noise/bundled/report.html")).words()
    page = Parsed(served.text("/shot_noise/bundled/"))
    assert "35 to go" in page.words()
    newest = next(reversed(page.tables.values()))
    assert [cells[0] for cells in newest[1:]] == [each["model"] for each in reversed(rows[:stored])]


def test_the_table_of_a_running_study_is_that_of_the_rows_so_far(served, real):
    folder, rows = real
    with RowStore(folder) as store:
        store.write_plan([each["trial_id"] for each in rows])
        for stored in (15, 30):
            store.add(*rows[stored - 15 : stored])
            page = until(served, "/shot_noise/bundled/", f"From {stored} trials.")
            assert page.tables["current"][1:] == Results.load(folder).main_table.cells()


def test_the_report_takes_the_place_of_the_live_page_when_it_is_written(served, real):
    folder, rows = real
    with RowStore(folder) as store:
        store.add(rows[0])
    address = "/shot_noise/bundled/report.html"
    assert "data-live" in served.text(address)
    (folder / "report.html").write_text("<p>the report</p>")
    assert served.text(address) == served.text("/shot_noise/bundled/") == "<p>the report</p>"
    assert address in [attrs.get("href") for _, attrs in Parsed(served.text("/")).elements]
    assert "data-live" in served.text("/-/live/shot_noise/bundled/")


def test_a_folder_without_its_slash_leads_to_the_page_and_nowhere_else(served, real):
    folder, rows = real
    with RowStore(folder) as store:
        store.add(rows[0])
    status, headers, _ = served.ask("/shot_noise/bundled")
    assert (status, headers["location"]) == (307, "/shot_noise/bundled/")
    assert served.ask("/shot_noise/")[0] == 404


def test_a_page_that_has_not_changed_is_not_sent_again(served, real):
    folder, rows = real
    with RowStore(folder) as store:
        store.add(rows[0])
    _, headers, _ = served.ask("/")
    assert served.ask("/", If_None_Match=headers["etag"])[::2] == (304, b"")
    with RowStore(folder) as store:
        store.add(rows[1])
        assert served.ask("/", If_None_Match=headers["etag"])[0] == 200


HOSTILE = "<img src=x onerror=alert(1)>\"'&<script>alert(2)</script>"


def test_names_from_files_are_shown_and_never_understood(served):
    folder = served.root / "<b onclick=alert(1)>&'" / 'a"><script>alert(3)<'
    try:
        folder.mkdir(parents=True)
    except OSError:
        pytest.skip("this file system has no such names")
    config = yaml.safe_load((SOURCE / "config.yaml").read_text("utf-8")) | {"title": HOSTILE}
    (folder / "config.yaml").write_text(yaml.safe_dump(config), "utf-8")
    (folder / "x<script>.csv").touch()
    with RowStore(folder) as store:
        store.add(row("1", model=HOSTILE, segmenter=HOSTILE, part=HOSTILE, level=0.1, status=HOSTILE, error=HOSTILE))
    index = Parsed(served.text("/"))
    (link,) = [attrs["href"] for tag, attrs in index.elements if tag == "a" and "onclick" in attrs["href"]]
    until(served, link, "table")
    for page in (index, Parsed(served.text(link))):
        scripts = [attrs for tag, attrs in page.elements if tag == "script"]
        assert scripts == [{"src": "/-/live.js", "defer": None}]
        assert not {"img", "b"} & {tag for tag, _ in page.elements}
        assert not [name for _, attrs in page.elements for name in attrs if name.startswith("on")]
        assert HOSTILE in page.text
        assert encodable(folder.relative_to(served.root).as_posix()) in page.text
    shutil.rmtree(folder.parent)


def test_what_cannot_be_read_is_a_line_and_not_the_end_of_the_others(served, real):
    folder, rows = real
    with RowStore(folder) as store:
        store.add(rows[0])
    broken = served.root / "broken" / "files"
    broken.mkdir(parents=True)
    (broken / "trials.parquet").write_bytes(b"PAR1")
    lines = {cells[0].split()[-1]: cells for cells in Parsed(served.text("/")).tables["studies"]}
    assert lines["broken/files"][1].startswith("cannot be read: ")
    assert lines["shot_noise/bundled"][1] == "1 of 1"
    assert "cannot be read: " in Parsed(served.text("/broken/files/")).words()
    shutil.rmtree(broken.parent)


def test_a_folder_whose_rows_are_elsewhere_is_not_read(served):
    outside = served.root.parent / "other"
    with RowStore(outside) as store:
        store.add(row("1", model="secret"))
    (served.root / "linked").mkdir()
    (served.root / "linked" / "trials.jsonl").symlink_to(outside / "trials.jsonl")
    assert "linked" not in served.text("/")
    assert served.ask("/linked/")[0] == 404
    shutil.rmtree(served.root / "linked")


def test_a_folder_without_results_says_so(served):
    assert "No study has written to this folder yet" in Parsed(served.text("/")).words()
