"""The interactive plates in a real browser: heat is picked, the slider moves on, cameras are linked."""

import numpy as np
import pytest
import trimesh

from heatwalk.io import LoadedMesh
from studies.figures.method_scenes import Shape, diffusion_scenes, showcase_scene, walk_scenes
from studies.reporting.html.plates_page import Plate, plates_page
from tests.helpers.browser import browser, open_page
from tests.studies.reporting.html.test_in_browser import drag, pixels


@pytest.fixture(scope="module")
def shape():
    mesh = trimesh.creation.icosphere(3).apply_scale([4, 1.2, 1])
    return Shape("egg", LoadedMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), ()))


@pytest.fixture(scope="module")
def opened(shape, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "plates.html"
    upright = Shape("upright", LoadedMesh(shape.mesh.vertices[:, [1, 0, 2]], shape.mesh.faces[:, ::-1], ()))
    made = [
        Plate(2, "Heat", "Look.", "egg", diffusion_scenes(shape)),
        Plate(3, "Walk", "Look.", "egg", walk_scenes(shape)),
        Plate(5, "Shapes", "Look.", "egg, upright", showcase_scene([shape, upright])),
    ]
    plates_page(made, "Plates", "").write(path)
    with browser() as started:
        page, complaints = open_page(started, path.as_uri(), viewport={"width": 900, "height": 900})
        page.evaluate("() => viewer.ready")
        page.wait_for_function("() => document.body.dataset.plates === 'ready'")
        yield page
        assert complaints == []


@pytest.fixture
def page(opened):
    opened.evaluate("() => { viewer.state.points.clear(); }")
    opened.locator(".strip button").nth(0).click()
    opened.get_by_role("button", name="reset view").click()
    return opened


def click(page, viewport, x, y):
    """Click a viewport at shares of its shorter side from its middle."""
    box = page.locator(".viewport").nth(viewport).bounding_box()
    side = min(box["width"], box["height"])
    page.mouse.click(box["x"] + box["width"] / 2 + x * side, box["y"] + box["height"] / 2 + y * side)


def test_a_click_moves_the_source_of_heat_on_that_side_alone(page, shape):
    before = [pixels(page, i)["hash"] for i in range(2)]
    points = [page.evaluate("(i) => viewer.point(i)", i) for i in range(2)]
    click(page, 0, 0.3, 0)
    picked = page.evaluate("() => viewer.point(0)")
    assert picked != points[0]
    assert page.evaluate("() => viewer.point(1)") == points[1]
    assert pixels(page, 0)["hash"] != before[0]
    # What was clicked is on the side of the viewer, and as far to the right as the click.
    right, _, towards = shape.axes @ shape.surface.vertices[picked]
    radius = np.linalg.norm(shape.surface.vertices, axis=1).max()
    assert towards > 0
    assert right == pytest.approx(0.3 * 2 * 1.12 * radius, abs=0.12 * radius)
    rows = shape.segmentation.kernel.factor[shape.reduced.source]
    found = np.array(list(page.evaluate("() => [...viewer.heat(0)]")))
    expected = rows @ rows[picked]
    assert np.abs(found - expected).max() < expected.max() / 254


def test_a_click_beside_the_surface_and_a_drag_pick_nothing(page):
    before = page.evaluate("() => viewer.point(0)")
    click(page, 0, 0.0, 0.48)
    drag(page, 40, 10)
    assert page.evaluate("() => viewer.point(0)") == before


def test_enter_picks_the_vertex_in_the_middle(page, shape):
    page.locator("#stage").press("Enter")
    picked = shape.axes @ shape.surface.vertices[page.evaluate("() => viewer.point(0)")]
    edge = np.linalg.norm(np.ptp(shape.surface.vertices[shape.surface.faces[0]], axis=0))
    assert np.hypot(*picked[:2]) < edge
    assert picked[2] > 0


def test_the_slider_changes_the_heat_and_keeps_its_source(page):
    click(page, 0, 0.2, 0)
    picked, before = page.evaluate("() => viewer.point(0)"), pixels(page, 0)["hash"]
    page.locator("#slider").press("End")
    assert page.evaluate("() => viewer.point(0)") == picked
    assert pixels(page, 0)["hash"] != before
    highest = page.locator(".viewport .scale").first.inner_text()
    assert float(highest.split()[-1]) == pytest.approx(
        page.evaluate("() => Math.max(...viewer.heat(1), ...viewer.heat(0))"), 0.01
    )


def test_the_slider_of_the_walk_ends_at_the_regions(page):
    page.locator(".strip button").nth(1).click()
    assert page.locator("#pickers").inner_text().count("steps")
    assert pixels(page, 0)["hash"] != pixels(page, 1)["hash"]
    page.locator("#slider").press("End")
    assert pixels(page, 0)["hash"] == pixels(page, 1)["hash"]
    assert page.locator(".captions article.current h3").inner_text() == "Walk"


def test_shapes_seen_from_their_own_directions_turn_together(page):
    page.locator(".strip button").nth(2).click()
    first, second = (pixels(page, i)["ink"] for i in range(2))
    drag(page, 60, 30)
    turned = [pixels(page, i)["ink"] for i in range(2)]
    assert turned[0] != first
    assert turned[1] != second


def test_on_paper_there_is_every_plate(page):
    page.evaluate("() => dispatchEvent(new Event('beforeprint'))")
    sources = page.evaluate("() => [...document.querySelectorAll('.captions img')].map((each) => each.src)")
    page.evaluate("() => dispatchEvent(new Event('afterprint'))")
    assert len(set(sources)) == 3
    assert all(source.startswith("data:image/png") and len(source) > 5000 for source in sources)
