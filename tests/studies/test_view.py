"""``heatwalk view``: the page contains what the method computes, and a browser draws it."""

import base64
import io
import itertools
import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.optimize import linear_sum_assignment

import heatwalk
import perturb
from heatwalk.cli import main
from heatwalk.segmentation import bent_torus
from studies.figures import time_scenes
from studies.figures.colours import BACKGROUND
from studies.figures.scenes import Field, Scene, Surface, Viewport
from studies.metrics import change_percentage
from studies.reporting.html import Page, pack, stored_scenes, unpack
from tests.helpers.browser import SECONDS, browser

ROOT = Path(heatwalk.__file__).parents[1]
TIMES = time_scenes.times_around(1.0)
WORDS = ["--perturbation", "shot_noise", "--amount", "0.2", "--seed", "3"]


@pytest.fixture(scope="module", autouse=True)
def installed(tmp_path_factory):
    """The entry points that an installation of this project has."""
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"]
    folder = tmp_path_factory.mktemp("site") / "heatwalk-0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: heatwalk\nVersion: 0\n", "utf-8")
    lines = [f"[{group}]\n" + "\n".join(f"{k} = {v}" for k, v in points.items()) for group, points in groups.items()]
    (folder / "entry_points.txt").write_text("\n".join(lines), "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder.parent)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a torus, its page, and what the command printed."""
    folder = tmp_path_factory.mktemp("view")
    trimesh.Trimesh(*bent_torus(18), process=False).export(folder / "torus.ply", vertex_normal=False)
    assert main(["view", str(folder / "torus.ply"), *WORDS, "--robust", "--output", str(folder / "page.html")]) == 0
    return folder


@pytest.fixture(scope="module")
def torus(folder):
    mesh = heatwalk.read_mesh(folder / "torus.ply")
    return mesh.vertices, mesh.faces


@pytest.fixture(scope="module")
def variant(torus):
    """The variant that the options define."""
    noise = perturb.ShotNoise(amount=0.2, unit="share_of_vertices", height=1.0, height_unit="mean_edge_length")
    return noise(perturb.as_trimesh(*torus), np.random.default_rng(3))


@pytest.fixture(scope="module")
def scenes(folder):
    """The scenes of the page, by time."""
    found = unpack(stored_scenes(folder / "page.html"))
    assert found[0].at == {"time": 1.0}, "the time that was asked for is shown first"
    return {scene.at["time"]: scene for scene in found}


def same_parts(shown, segmentation):
    """Whether labels are those of a segmentation but for their numbers, with the dissipator region as background."""
    dissipator = segmentation.labels == len(segmentation.exemplars)
    pairs = set(zip(shown.tolist(), segmentation.labels.tolist(), strict=True))
    return np.array_equal(shown == BACKGROUND, dissipator) and len(pairs) == segmentation.n_segments == len(set(shown))


def test_the_page_has_the_segments_of_twenty_times(scenes, torus):
    assert sorted(scenes) == TIMES
    assert len(TIMES) == 20
    assert min(TIMES) < 0.3 < 3 < max(TIMES)
    counts = set()
    for time, scene in scenes.items():
        expected = heatwalk.segment(*torus, time=time)
        assert same_parts(scene.viewports[0].labels, expected)
        assert scene.viewports[0].note == f"{expected.n_segments} segments"
        counts.add(expected.n_segments)
    assert len(counts) > 3


def test_the_segments_of_variants_and_of_the_robust_variant_are_those_of_the_functions(scenes, torus, variant):
    shown = variant.mesh.vertices, variant.mesh.faces
    for time in TIMES[::9]:
        viewports = scenes[time].viewports
        assert [each.title for each in viewports] == ["original", "variant"] * 2
        assert [each.row for each in viewports] == ["Heat Walk"] * 2 + ["robust variant"] * 2
        assert same_parts(viewports[1].labels, heatwalk.segment(*shown, time=time))
        assert same_parts(viewports[2].labels, heatwalk.segment_robust(*torus, time=time))
        assert same_parts(viewports[3].labels, heatwalk.segment_robust(*shown, time=time))


def test_the_variant_is_that_of_the_seed(scenes, variant):
    vertices = scenes[1.0].viewports[1].surface.vertices
    assert np.abs(vertices - variant.mesh.vertices).max() <= np.ptp(variant.mesh.vertices, axis=0).max() / 65535
    assert np.array_equal(scenes[1.0].viewports[1].surface.faces, variant.mesh.faces)


def test_change_is_counted_and_marked(scenes, torus, variant):
    for time in TIMES[::9]:
        before = heatwalk.segment(*torus, time=time)
        after = heatwalk.segment(variant.mesh.vertices, variant.mesh.faces, time=time)
        change = change_percentage(before.labels, after.labels[variant.counterpart])
        original, changed = scenes[time].viewports[:2]
        assert changed.note == f"{after.n_segments} segments, CP {change:.1f} %"
        assert np.count_nonzero(original.changed) == round(change / 200 * len(before.labels))
        assert np.array_equal(original.changed, changed.changed[variant.counterpart])


def test_a_part_has_one_colour_on_both_sides_and_over_time(scenes):
    def agreement(a, b):
        """How many points of the parts of two segmentations have equal numbers, and how many could have."""
        both = (a >= 0) & (b >= 0)
        table = np.zeros((a.max() + 1, b.max() + 1), int)
        np.add.at(table, (a[both], b[both]), 1)
        rows, columns = linear_sum_assignment(table, maximize=True)
        return np.count_nonzero(a[both] == b[both]), table[rows, columns].sum()

    for time, nearer in itertools.pairwise(TIMES[:11]):
        equal, possible = agreement(scenes[nearer].viewports[0].labels, scenes[time].viewports[0].labels)
        assert equal == possible > 0
    for scene in scenes.values():
        for i, j in ((0, 1), (2, 3), (0, 2)):
            equal, possible = agreement(scene.viewports[i].labels, scene.viewports[j].labels)
            assert equal == possible


def near(field, values):
    """Whether a field has these values, up to the steps in which a page contains them."""
    step = (field.high - field.low) / 254
    return np.abs(field.values - np.clip(values, field.low, field.high)).max() <= step / 2 + 1e-5 * step + 1e-12


def test_functions_are_those_of_the_segmentation_up_to_the_steps_of_the_page(scenes, torus):
    for time in TIMES[::9]:
        for viewport, segment in ((0, heatwalk.segment), (2, heatwalk.segment_robust)):
            fields, seg = scenes[time].viewports[viewport].fields, segment(*torus, time=time)
            n = len(torus[0])
            assert near(fields["heat kernel signature"], seg.kernel.diagonal()[:n])
            assert near(fields["margin"], seg.margin)
            assert near(fields["dissipator test"], seg.relative_entropy_excess)
            assert near(fields["divergence from uniform"], seg.divergence_from_uniform)
            assert near(fields["divergence from region"], seg.divergence_from_region)


def test_ends_of_colours_are_percentiles_of_the_original_on_both_sides(scenes, torus):
    expected = np.percentile(heatwalk.segment(*torus).kernel.diagonal(), [5, 95])
    for viewport in scenes[1.0].viewports:
        field = viewport.fields["heat kernel signature"]
        assert (field.low, field.high) == pytest.approx(tuple(expected))
        test = viewport.fields["dissipator test"]
        assert test.diverging
        assert test.low == -test.high < 0


def test_labels_and_functions_of_large_meshes_are_carried_over_to_the_vertices_that_are_shown(torus, monkeypatch):
    monkeypatch.setattr(time_scenes, "MOST_FACES", 300)
    monkeypatch.setattr(time_scenes, "MOST_DIVERGENCES", 300)
    (side,) = time_scenes.sides_of(torus, None, [0.5, 1, 2], {"Heat Walk": False})
    assert 100 < len(side.surface.faces) <= 300
    assert np.array_equal(side.surface.vertices, torus[0][side.reduced.source])
    scene = time_scenes.scenes_by_time([0.5, 1, 2], [side], first=1)[0]
    seg = heatwalk.segment(*torus)
    assert same_parts(side.at_times[1].labels, seg)
    assert np.array_equal(scene.viewports[0].labels, side.at_times[1].labels[side.reduced.source])
    assert scene.viewports[0].note == f"{seg.n_segments} segments"
    margin = scene.viewports[0].fields["margin"].values
    np.testing.assert_allclose(margin, seg.margin[side.reduced.source], rtol=1e-6, atol=1e-9)
    assert set(scene.viewports[0].fields) == {"heat kernel signature", "margin", "dissipator test"}


def test_a_page_has_less_than_15_megabytes_however_large_the_mesh_is():
    rng, n = np.random.default_rng(0), time_scenes.MOST_FACES // 2 + 2
    scenes = []
    surfaces = [Surface(rng.random((n, 3)), rng.integers(n, size=(time_scenes.MOST_FACES, 3))) for _ in range(2)]
    for time in TIMES[::4]:
        viewports = [
            Viewport(
                surfaces[i % 2],
                labels=rng.integers(240, size=n),
                changed=rng.random(n) < 0.5,
                fields={name: Field(rng.random(n)) for name in ("a", "b", "c")},
            )
            for i in range(4)
        ]
        scenes.append(Scene({"time": time}, viewports))
    assert 4 * len(Page("noise", scenes=pack(scenes, slider="time")).html()) < 15e6


def error_of(capsys):
    """The one line on stderr."""
    error = capsys.readouterr().err
    assert re.fullmatch(r"heatwalk: error: [^\n]+\n", error)
    return error


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["nothing.ply"], "nothing.ply"),
        (
            ["torus.ply", "--perturbation", "shot_nois"],
            "there is no perturbation 'shot_nois'.*holes .removed, triangles",
        ),
        (["torus.ply", "--perturbation", "shot_noise", "--amount", "2"], "shot_noise: amount is 2.*at most 1"),
        (["torus.ply", "--perturbation", "holes", "--amount", "999"], "torus.ply: holes"),
        (["torus.ply", "--amount", "2"], "--amount needs --perturbation"),
        (["torus.ply", "--output", "nowhere/page.html"], "no such directory"),
        (["torus.ply", "--output", "notes.html"], "notes.html: exists.*--force"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(words, expected, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    Path("notes.html").write_text("<p>mine", "utf-8")
    assert main(["view", *words]) == 2
    assert re.search(expected, error_of(capsys))
    assert Path("notes.html").read_text("utf-8") == "<p>mine"


@pytest.mark.parametrize("words", [["--output", "torus.ply"], ["--seed", "-1"], ["--amount", "nan"], ["--time", "0"]])
def test_invalid_values_of_options_are_refused(words, folder, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["view", str(folder / "torus.ply"), *words])
    assert stopped.value.code == 2
    assert f"argument {words[0]}: must" in capsys.readouterr().err


def test_help_on_perturbations_lists_them_with_units_and_levels(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["view", "--perturbation", "help"])
    assert stopped.value.code == 0
    listed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert listed["holes"] == "removed, triangles: 58, 106, 154, 202, 250"
    assert listed["figure10"].startswith("height of the spikes, bounding box diagonal: 0.11, ")
    assert set(perturb.names()) <= set(listed)


@pytest.mark.parametrize("opens", [True, False])
def test_the_page_is_opened_in_a_browser_or_its_path_printed(opens, folder, tmp_path, monkeypatch, capsys):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or opens)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(time_scenes, "TIMES", 11)
    assert main(["view", str(folder / "torus.ply"), "--time", "2"]) == 0
    (path,) = tmp_path.rglob("*.html")
    assert opened == [path.as_uri()]
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == (f"opened: {path}" if opens else f"no browser can be opened here; the page is {path}")
    assert unpack(stored_scenes(path))[0].at == {"time": 2.0}


@pytest.mark.parametrize(("many", "very_many", "expected"), [(10, 10_000, [2.0, 1.52, 2.64]), (10, 20, [2.0])])
def test_of_large_meshes_fewer_times_are_shown(many, very_many, expected, folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(time_scenes, "MANY_VERTICES", many)
    monkeypatch.setattr(time_scenes, "VERY_MANY_VERTICES", very_many)
    path = tmp_path / "page.html"
    assert main(["view", str(folder / "torus.ply"), "--time", "2", "--output", str(path)]) == 0
    scenes = unpack(stored_scenes(path))
    assert [scene.at["time"] for scene in scenes] == expected
    assert (time_scenes.MARGIN in scenes[0].viewports[0].fields) == (len(expected) > 1)
    assert " to " not in capsys.readouterr().out or len(expected) > 1
    text = path.read_text("utf-8")
    assert ("Segments by time" in text, "one time is shown" in text) == (len(expected) > 1, len(expected) == 1)


def test_help_lists_the_command_and_loads_nothing_large(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    assert "  view  " in capsys.readouterr().out


def test_an_installation_from_before_the_command_says_what_to_do(monkeypatch, capsys):
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: [])
    assert main(["view", "torus.ply"]) == 2
    assert re.search(
        r"no command 'view': choose one of segment, inspect, example;.*pip install -e \.", error_of(capsys)
    )


def test_a_command_that_cannot_be_loaded_is_left_out(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "studies.view", None)
    with pytest.raises(SystemExit) as stopped:
        main(["--help"])
    printed = capsys.readouterr()
    assert stopped.value.code == 0
    assert "{segment,inspect,example}" in printed.out
    assert re.fullmatch("heatwalk: the command 'view' is left out: [^\n]+\n", printed.err)


@pytest.fixture(scope="module")
def opened(folder):
    """The page in a browser, and what it printed to the console as errors."""
    with browser() as started:
        page = started.new_page(viewport={"width": 800, "height": 700})
        page.set_default_timeout(1000 * SECONDS)
        errors = []
        page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto((folder / "page.html").as_uri())
        page.evaluate("viewer.ready")
        yield page, errors


def drawn(page):
    """The canvas as an array, as it is now."""
    from PIL import Image

    page.evaluate("viewer.paint()")
    address = page.evaluate("document.getElementById('canvas').toDataURL('image/png')")
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))))


def test_the_slider_and_the_colours_change_what_is_drawn(opened, scenes):
    page, errors = opened
    first = drawn(page)
    width = first.shape[1]
    for half in (first[:, : width // 2], first[:, width // 2 :]):
        assert 0.1 < np.count_nonzero(half[..., 3]) / half[..., 3].size < 0.95

    slider = page.locator("#slider")
    assert int(slider.get_attribute("max")) == len(TIMES) - 1
    assert slider.input_value() == str(TIMES.index(1.0))
    for position in (0, 19):
        slider.fill(str(position))
        assert not np.array_equal(drawn(page), first)
        assert np.array_equal(drawn(page)[..., 3] > 0, first[..., 3] > 0), "the surfaces stay"
        notes = page.locator(".viewport .note").all_inner_texts()
        assert notes == [viewport.note for viewport in scenes[TIMES[position]].viewports]
    slider.fill(str(TIMES.index(1.0)))
    assert np.array_equal(drawn(page), first)

    images = [first]
    for name in scenes[1.0].viewports[0].fields:
        page.select_option("#field", name)
        field = scenes[1.0].viewports[0].fields[name]
        assert field.unit in page.locator("#scale").inner_text()
        images.append(drawn(page))
    assert len({image.tobytes() for image in images}) == 6
    assert errors == []
