"""Pages in a real browser: what is drawn, turned, picked, sorted and printed."""

import math
import re

import pytest

from tests.helpers.browser import SECONDS, browser
from tests.studies.reporting.html.pages import HOSTILE, METHODS, ROWS, whole_page

MARGIN = 1.12  # around a surface

# The pixels of a viewport: a picture of it, how many are drawn, and how many of these are red and blue.
PIXELS = """(i) => {
  viewer.paint();
  const canvas = document.getElementById("canvas"), outer = document.getElementById("stage").getBoundingClientRect();
  const inner = viewer.cells()[i].cell.getBoundingClientRect();
  const [w, h] = [Math.round(inner.width), Math.round(inner.height)];
  const copy = new OffscreenCanvas(w, h).getContext("2d");
  copy.drawImage(canvas, -Math.round(inner.left - outer.left - 1), -Math.round(inner.top - outer.top - 1));
  const data = copy.getImageData(0, 0, w, h).data;
  let hash = 0, ink = 0, red = 0, blue = 0, left = 0;
  for (let k = 0; k < data.length; k += 4) {
    hash = (hash * 31 + data[k] + 7 * data[k + 1] + 49 * data[k + 2] + data[k + 3]) % 4294967291;
    if (!data[k + 3]) continue;
    ink++;
    if (data[k] > 2 * data[k + 2]) red++;
    if (data[k + 2] > 2 * data[k]) { blue++; left += (k / 4) % w < w / 2; }
  }
  return { hash, ink: ink / (w * h), red: red / ink, blue: blue / ink, left };
}"""


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "report.html"
    whole_page().write(path)
    return path.as_uri()


@pytest.fixture(scope="module")
def opened(chromium, address):
    """The page, and what its console says."""
    page = chromium.new_page(viewport={"width": 1100, "height": 800})
    page.set_default_timeout(1000 * SECONDS)
    said = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on(
        "request",
        lambda request: None if request.url.startswith(("file:", "data:", "blob:")) else said.append(request.url),
    )
    page.goto(address)
    page.evaluate("() => viewer.ready")
    yield page, said
    assert said == []  # after all tests
    page.close()


@pytest.fixture
def page(opened):
    """The page as it is when it has been opened."""
    page, _ = opened
    page.evaluate("() => { viewer.state.field = ''; viewer.state.hidden.clear(); viewer.show(0); }")
    if page.locator("#highlight").get_attribute("aria-pressed") == "true":
        page.locator("#highlight").click()
    page.get_by_role("button", name="reset view").click()
    return page


def pixels(page, viewport):
    return page.evaluate(PIXELS, viewport)


def drag(page, dx, dy):
    box = page.locator(".viewport").first.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + dx, y + dy)
    page.mouse.up()


def test_nothing_is_said_on_the_console_and_nothing_is_requested(page, opened):
    assert opened[1] == []
    assert page.evaluate("() => window.broken") is None
    assert page.locator("img[src='x']").count() == 0
    assert page.locator("h1").inner_text() == HOSTILE


def test_a_viewport_shows_the_surface_in_the_colours_of_its_parts(page):
    shown = pixels(page, 0)
    assert shown["ink"] == pytest.approx(math.pi / 4 / MARGIN**2, rel=0.03)  # a disc that touches the margin
    assert shown["blue"] == pytest.approx(0.3, abs=0.08)  # the cap beyond .3 of the radius
    assert shown["red"] == pytest.approx(1 - shown["blue"], abs=0.03)
    assert shown["left"] == 0  # it is on the right


def test_all_viewports_are_of_one_canvas_and_equal_surfaces_are_drawn_alike(page):
    assert page.locator("canvas").count() == 1
    assert page.locator(".viewport").count() == 2 * len(METHODS)
    assert len({pixels(page, i)["hash"] for i in range(4)}) == 1  # at level 0, the variant is the original


def test_dragging_turns_all_surfaces_alike_and_dragging_back_undoes_it(page):
    before = pixels(page, 0)
    drag(page, 150, 0)
    turned = [pixels(page, i) for i in range(4)]
    assert len({each["hash"] for each in turned}) == 1
    assert turned[0]["blue"] < 0.5 * before["blue"] or turned[0]["blue"] > 1.5 * before["blue"]
    drag(page, -150, 0)
    assert pixels(page, 1)["blue"] == pytest.approx(before["blue"], abs=0.01)


def test_the_wheel_zooms_all_surfaces_and_a_double_click_resets_them(page):
    before = pixels(page, 0)
    page.locator("#stage").hover(position={"x": 100, "y": 100})
    page.mouse.wheel(0, 400)
    page.wait_for_function("() => viewer.state.zoom < 1")
    factor = page.evaluate("() => viewer.state.zoom")
    smaller = [pixels(page, i) for i in range(4)]
    assert len({each["hash"] for each in smaller}) == 1
    assert smaller[0]["ink"] == pytest.approx(factor**2 * before["ink"], rel=0.05)
    page.locator("#stage").dblclick()
    assert pixels(page, 0) == before


def test_keys_turn_zoom_and_reset(page):
    before = pixels(page, 0)
    page.locator("#stage").focus()
    page.keyboard.press("ArrowRight")
    assert pixels(page, 0)["hash"] != before["hash"]
    page.keyboard.press("ArrowLeft")
    assert pixels(page, 0)["blue"] == pytest.approx(before["blue"], abs=0.01)
    page.keyboard.press("+")
    assert pixels(page, 0)["ink"] > 1.2 * before["ink"]
    page.keyboard.press("Home")
    assert pixels(page, 0) == before


def test_the_slider_shows_other_levels(page):
    slider = page.locator("#slider")
    before = [pixels(page, i) for i in range(2)]
    slider.focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert page.locator("output").inner_text() == "0.3"
    assert page.locator(".viewport .note").nth(1).inner_text() == "CP 30 %"
    after = [pixels(page, i) for i in range(2)]
    assert after[0]["blue"] == pytest.approx(before[0]["blue"], abs=0.01)  # the original stays
    assert after[1]["blue"] > after[0]["blue"] + 0.05  # the right part of the variant has grown
    page.keyboard.press("Home")
    assert [pixels(page, i) for i in range(2)] == before


def test_what_changed_is_highlighted_in_original_and_variant(page):
    page.evaluate("() => viewer.show(2)")
    before = [pixels(page, i) for i in range(2)]
    page.locator("#highlight").click()
    assert page.locator("#highlight").get_attribute("aria-pressed") == "true"
    for i in range(2):
        after = pixels(page, i)
        assert after["ink"] == before[i]["ink"]
        assert after["red"] + after["blue"] < 0.4  # what did not change is pale
        assert after["red"] + after["blue"] > 0.02  # what did is not


def test_a_function_is_shown_instead_of_segments_and_explained(page):
    before = pixels(page, 0)
    page.locator("#field").select_option("margin")
    assert pixels(page, 0)["hash"] != before["hash"]
    assert page.locator("#scale").inner_text().split() == ["0", "1", "margin"]
    page.locator("#field").select_option("")
    assert pixels(page, 0) == before
    assert page.locator("#scale").is_hidden()


def test_methods_are_hidden_and_shown(page):
    box = page.locator("#rows input").nth(1)
    box.uncheck()
    assert page.locator(".viewport").count() == 2
    box.check()
    assert page.locator(".viewport").count() == 4


def test_another_model_is_picked_at_the_same_level(page):
    page.evaluate("() => viewer.show(2)")
    page.locator("#pick-model").select_option(index=1)
    assert page.evaluate("() => viewer.state.scene") == 5
    assert page.locator("#pick-model option").all_inner_texts() == ["ball", HOSTILE]


def test_the_worst_come_first_and_lead_to_their_scenes(page):
    worst = page.locator("#worst button")
    assert [text.rpartition(", ")[2] for text in worst.all_inner_texts()] == ["0.3", "0.3", "0.1", "0.1", "0", "0"]
    worst.nth(1).click()
    assert page.evaluate("() => viewer.state.scene") == 5
    assert worst.nth(1).get_attribute("aria-current") == "true"


def test_a_point_of_a_chart_tells_its_trial_and_leads_to_it(page):
    point = page.locator("circle[data-scene]")
    point.hover()
    assert page.locator("#tip").inner_text() == f"{HOSTILE}: 30"
    point.click()
    assert page.evaluate("() => viewer.state.scene") == 5
    page.evaluate("() => viewer.show(0)")
    point.focus()
    page.keyboard.press("Enter")
    assert page.evaluate("() => viewer.state.scene") == 5


def names(page):
    return [row.split("\t")[0] for row in page.locator("tbody tr:visible").all_inner_texts()]


def test_a_table_is_sorted_by_values_and_what_is_missing_comes_last(page):
    heading = page.locator("th").nth(1)
    by_value = [name for name, value in sorted(ROWS, key=lambda row: (row[1] is None, row[1]))]
    heading.locator("button").click()
    assert heading.get_attribute("aria-sort") == "ascending"
    assert names(page) == by_value
    heading.locator("button").press("Enter")
    assert heading.get_attribute("aria-sort") == "descending"
    assert names(page) == [*reversed(by_value[:-1]), by_value[-1]]
    heading.locator("button").click()
    assert heading.get_attribute("aria-sort") == "none"
    assert names(page) == [name for name, _ in ROWS]


def test_a_table_is_filtered_by_words(page):
    box = page.locator(".filter input")
    box.fill("WALK")
    assert names(page) == ["walk", "walk two"]
    assert page.locator(".count").inner_text() == "2 of 6"
    box.fill("walk -1")
    assert names(page) == ["walk two"]
    box.fill("")
    assert len(names(page)) == len(ROWS)


def test_the_theme_is_changed_by_a_button(page):
    ground = "() => getComputedStyle(document.body).backgroundColor"
    light = page.evaluate(ground)
    page.locator("#theme").click()
    dark = page.evaluate(ground)
    assert sum(map(int, re.findall(r"\d+", dark))) < 150 < 600 < sum(map(int, re.findall(r"\d+", light)))
    page.locator("#theme").click()
    assert page.evaluate(ground) == light


def test_what_is_drawn_is_printed(page):
    page.evaluate("() => dispatchEvent(new Event('beforeprint'))")
    printed = page.locator("#printed")
    assert printed.is_visible()
    width = "async (picture) => { await picture.decode(); return picture.naturalWidth; }"
    assert printed.evaluate(width) == 3 * page.locator("#stage").evaluate("(stage) => stage.clientWidth")
    page.evaluate("() => dispatchEvent(new Event('afterprint'))")
    assert printed.is_hidden()


def test_nothing_is_wider_than_a_phone(page):
    page.set_viewport_size({"width": 360, "height": 700})
    try:
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 360
        page.wait_for_function("() => document.getElementById('canvas').clientWidth < 360")
        assert 0.2 < pixels(page, 3)["ink"] < 0.8
    finally:
        page.set_viewport_size({"width": 1100, "height": 800})


def test_a_finger_scrolls_past_a_viewer_that_nearly_fills_the_screen(page):
    touch = "() => getComputedStyle(document.getElementById('stage')).touchAction"
    assert page.evaluate(touch) == "none"
    page.set_viewport_size({"width": 360, "height": 420})
    try:
        page.wait_for_function(f"() => ({touch})() === 'pan-y'")
        assert page.evaluate("() => document.getElementById('stage').clientHeight") > 0.6 * 420
    finally:
        page.set_viewport_size({"width": 1100, "height": 800})
        page.wait_for_function(f"() => ({touch})() === 'none'")


def test_a_browser_without_webgl_says_so_and_shows_the_rest(chromium, address):
    page = chromium.new_page()
    said = []
    page.on("pageerror", lambda error: said.append(str(error)))
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto(address)
    assert page.locator("#fallback").is_visible()
    assert page.locator("#viewer").is_hidden()
    assert len(names(page)) == len(ROWS)
    assert said == []
    page.close()
