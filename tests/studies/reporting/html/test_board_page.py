"""The page of a leaderboard: what its cells open, its cards, and both in a real browser."""

import json

import numpy as np
import pytest

from studies.experiments.experiment import row_columns
from studies.experiments.leaderboard import Leaderboard
from studies.reporting.html import Scene, Surface, Viewport, pack
from studies.reporting.html.board_page import WORST_SHOWN, board_table, cell_details, methods_block
from studies.reporting.html.study_page import study_page
from studies.reporting.results import Results
from tests.helpers.browser import browser, open_page
from tests.studies.experiments.leaderboard.boards import drawn

METHODS = ("HeatWalk", "cuts", "Voronoi")
PARTS = {
    name: {"perturbation": {"_target_": "perturb.ShotNoise"}, "levels": [4.0, 3.0, 2.0, 1.0, 0.0], "title": title}
    for name, title in (("holes", "Holes"), ("noise", "Shot <noise>"), ("rotation", "Rotation"))
}
HOSTILE = "</script><img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results of a board whose rows are drawn, with failures, and names that are no HTML."""
    rows = drawn(METHODS, list(PARTS), 3, seed=3)
    rows.loc[rows["status"] != "ok", "error"] = f"no mesh {HOSTILE}"
    rows["trial_id"] = [f"t{i}" for i in range(len(rows))]
    rows["model"] = rows["model"].replace({"m0": HOSTILE})
    rows = rows.assign(study="leaderboard", dataset="drawn", category="", perturbation="shot_noise", unit="share_of_it")
    columns = [column.name for column in row_columns(Leaderboard) if column.name not in rows]
    rows = rows.assign(**dict.fromkeys(columns, np.nan))
    folder = tmp_path_factory.mktemp("board")
    return Results(folder, "leaderboard", "Leaderboard", Leaderboard(parts=PARTS, controls=("rotation",)), rows)


@pytest.fixture(scope="module")
def details(results):
    experiment = results.experiment
    scores = experiment.scores(results.rows)
    numbers = {trial_id: i for i, trial_id in enumerate(results.rows["trial_id"])}
    return scores, cell_details(scores, experiment.named_parts(), numbers)


def test_a_cell_opens_the_trials_that_changed_most_with_the_scenes_that_show_them(results, details):
    scores, cells = details
    assert len(cells) == len(scores.parts) * len(METHODS)
    for i, part in enumerate(scores.parts):
        for j, method in enumerate(scores.board["segmenter"]):
            rows = results.rows[(results.rows["part"] == part) & (results.rows["segmenter"] == method)]
            values = sorted(rows["change_percentage"].dropna(), reverse=True)[:WORST_SHOWN]
            found = cells[f"{i} {j}"]["worst"]
            assert [float(change) for _, change, *_ in found] == pytest.approx(values, abs=0.051)
            for model, change, level, repeat, scene in found:
                row = results.rows.iloc[scene]
                assert (row["model"], f"{row['level']:g} share of it", row["repeat"] + 1) == (model, level, repeat)
                assert float(change) == pytest.approx(row["change_percentage"], abs=0.051)


def test_the_curve_of_a_cell_has_the_means_in_the_order_of_the_study(results, details):
    scores, cells = details
    i, j = scores.parts.index("noise"), list(scores.board["segmenter"]).index("cuts")
    found = cells[f"{i} {j}"]
    for curve, method in ((found["curve"], "cuts"), (found["reference"], "HeatWalk")):
        assert [level for level, _ in curve] == PARTS["noise"]["levels"]
        for level, mean in curve:
            rows = results.rows
            rows = rows[(rows["part"] == "noise") & (rows["segmenter"] == method) & (rows["level"] == level)]
            assert mean == pytest.approx(rows["change_percentage"].mean(), abs=0.006)


def test_failures_of_a_cell_are_counted_with_their_reasons(results, details):
    scores, cells = details
    failed = results.rows[(results.rows["status"] != "ok") & (results.rows["part"] != "original")]
    assert len(failed) > 0
    for (part, method), group in failed.groupby(["part", "segmenter"]):
        found = cells[f"{scores.parts.index(part)} {list(scores.board['segmenter']).index(method)}"]
        assert found["failures"] == [f"{len(group)} × no mesh {HOSTILE}"]
        assert found["facts"][-1].endswith(f", {len(group)} of which failed")
    assert sum(len(cell["failures"]) for cell in cells.values()) == failed.groupby(["part", "segmenter"]).ngroups


def test_every_method_of_the_board_leads_to_its_card(results):
    cards = methods_block(results).cards
    at = [heading.text for heading in board_table(results).headings].index("method")
    assert [row[at].link for row in board_table(results).rows] == [f"#{card.anchor}" for card in cards]
    walk = next(card for card in cards if card.title == "Heat Walk")
    assert walk.bibtex.startswith("@article{benjamin2011heatwalk,")
    assert dict(walk.facts)["mCE"] == "1.00 (1.00 – 1.00)"
    assert "baseline" in next(card for card in cards if card.title == "Voronoi cells").badges


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def scenes(details):
    """The worst case of the second method under the first perturbation, as all methods have segmented it."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    surface = Surface(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
    worst = details[1]["0 1"]["worst"][0][-1]
    viewports = [Viewport(surface, "variant", method, labels=np.arange(4)) for method in METHODS]
    return pack([Scene({"model": f"m{i}"}, viewports, key=key) for i, key in enumerate(("other", f"t{worst} further"))])


@pytest.fixture(scope="module")
def address(results, scenes):
    study_page(results, scenes).write(results.folder / "report.html")
    return (results.folder / "report.html").as_uri()


def test_a_worst_case_is_shown_in_the_viewer_with_the_surfaces_of_its_method_alone(chromium, address, details):
    page, complaints = open_page(chromium, address)
    page.locator("#stage[data-ready=true]").wait_for()
    page.locator("rect.cell[data-row='0'][data-column='1']").click()
    buttons = page.locator("#cell-worst button")
    assert buttons.count() == 1  # of the other trials there are no scenes
    buttons.click()
    assert not page.locator("#cell").is_visible()
    assert page.evaluate("window.viewer.state.scene") == 1
    assert page.evaluate("window.viewer.cells().map((each) => each.viewport.row)") == [details[1]["0 1"]["method"]]
    assert complaints == []


def test_names_from_rows_end_no_script_of_the_page(address, results, details):
    text = (results.folder / "report.html").read_text("utf-8")
    assert HOSTILE not in text
    stored = text.partition('<script type="application/json" id="cells">')[2].partition("</script>")[0]
    assert json.loads(stored).keys() == details[1].keys()


def test_a_click_opens_a_cell_and_keys_open_the_next(chromium, address, details):
    _, cells = details
    page, complaints = open_page(chromium, address)
    dialog = page.locator("#cell")
    page.locator("rect.cell[data-row='1'][data-column='1']").click()
    assert dialog.locator("h3").text_content() == cells["1 1"]["title"]
    shown = dialog.locator("#cell-worst tbody tr").all()
    assert [row.locator("td").all_text_contents()[:4] for row in shown] == [
        [str(cell) for cell in row[:4]] for row in cells["1 1"]["worst"]
    ]
    assert dialog.locator("circle").count() == len(cells["1 1"]["curve"])
    page.keyboard.press("Escape")
    assert not dialog.is_visible()
    first = page.locator("rect.cell[data-row='0'][data-column='0']")
    first.focus()
    for key in ("ArrowDown", "ArrowRight", "ArrowLeft", "Enter"):
        page.keyboard.press(key)
    assert dialog.locator("h3").text_content() == cells["1 0"]["title"]
    assert page.locator("rect.cell[tabindex='0']").count() == 1
    assert page.locator("img[src='x']").count() == 0
    assert complaints == []


def test_the_board_sorts_and_leads_to_cards_whose_citation_is_copied(chromium, address, results):
    page, complaints = open_page(chromium, address, permissions=["clipboard-read", "clipboard-write"])
    board = page.locator("section.table").first
    headings = board.locator("th").all_text_contents()
    board.locator("th button", has_text="CP %").first.click()
    at = [heading.strip() for heading in headings].index("CP %")
    shown = [float(row.locator("td").nth(at).text_content()) for row in board.locator("tbody tr").all()]
    assert shown == sorted(shown)
    board.locator("a", has_text="Heat Walk").click()
    card = page.locator("article:target")
    assert card.locator("h3").text_content() == "Heat Walk"
    card.locator("summary").click()
    card.locator("button.copy").click()
    card.locator("button.copy", has_text="copied").wait_for()
    assert complaints == []


@pytest.mark.parametrize("width", [390, 1200])
def test_no_page_is_wider_than_its_window(chromium, address, width):
    page, _ = open_page(chromium, address, viewport={"width": width, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= width
