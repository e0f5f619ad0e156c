import numpy as np
import pytest

from heatwalk.meshes import face_areas
from tests.helpers.mesh_files import FORMATS, read_bytes

POLYGON_FORMATS = [name for name in FORMATS if "stl" not in name]
CONCAVE = {
    "dart": [[2, -1], [0, 3], [-2, -1], [0, 0]],
    "U": [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]],
    "L": [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]],
    "comb": [[0, 0], [9, 0], [9, 4], [8, 4], [8, 2], [5, 2], [5, 4], [4, 4], [4, 2], [1, 2], [1, 4], [0, 4]],
    "spiral": [[0, 0], [5, 0], [5, 5], [1, 5], [1, 2], [3, 2], [3, 3], [2, 3], [2, 4], [4, 4], [4, 1], [0, 1]],
    "with corners on its sides": [[2, -1], [1, 1], [0, 3], [-2, -1], [-1, -0.5], [0, 0]],
}


def shoelace(corners):
    x, y = np.array(corners, dtype=float).T
    return abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def area(mesh):
    return face_areas(mesh.vertices, mesh.faces).sum()


def rotation(rng):
    return np.linalg.qr(rng.standard_normal((3, 3)))[0]


@pytest.mark.parametrize("fmt", POLYGON_FORMATS)
@pytest.mark.parametrize("name", CONCAVE)
def test_a_concave_polygon_is_covered_once_wherever_it_begins_and_however_it_is_turned(tmp_path, fmt, name):
    suffix, encode = FORMATS[fmt]
    corners = np.column_stack([CONCAVE[name], np.zeros(len(CONCAVE[name]))])
    rng = np.random.default_rng(7)
    for start in range(len(corners)):
        scale = 10.0 ** rng.integers(-20, 20)
        placed = scale * (corners @ rotation(rng) + 100 * rng.standard_normal(3))
        ring = np.roll(np.arange(len(corners)), start)[:: (-1) ** start].tolist()
        mesh = read_bytes(tmp_path, encode(placed, [ring]), suffix)
        assert area(mesh) == pytest.approx(shoelace(CONCAVE[name]) * scale**2, rel=1e-6)
        assert len(mesh.faces) == len(corners) - 2
        assert len(mesh.vertices) == len(corners)
        edges = {(x, y) for face in mesh.faces.tolist() for x, y in zip(face, [*face[1:], face[0]], strict=True)}
        assert set(zip(ring, [*ring[1:], ring[0]], strict=True)) <= edges  # the orientation of the polygon


def test_the_areas_of_the_polygons_are_those_known():
    assert [shoelace(CONCAVE[name]) for name in ("dart", "U", "L")] == [6, 7, 3]


@pytest.mark.parametrize("fmt", POLYGON_FORMATS)
def test_polygons_of_several_kinds_keep_their_places_when_some_are_concave(tmp_path, fmt):
    suffix, encode = FORMATS[fmt]
    dart, square = np.array(CONCAVE["dart"], dtype=float), np.array([[5, 5], [6, 5], [6, 6], [5, 6.0]])
    ell = np.array(CONCAVE["L"], dtype=float) + np.array([10, 0])
    vertices = np.column_stack([np.vstack([dart, square, ell]), np.zeros(14)])
    polygons = [[8, 9, 10, 11, 12, 13], [0, 1, 2, 3], [4, 5, 6, 7], [4, 5, 6], [11, 12, 13, 8, 9, 10]]
    mesh = read_bytes(tmp_path, encode(vertices, polygons), suffix)
    areas = face_areas(mesh.vertices, mesh.faces)
    assert mesh.faces[0].tolist() == [4, 5, 6]
    assert mesh.faces[[2, 4]].tolist() == [[4, 5, 6], [6, 7, 4]]
    assert areas[[1, 3]].sum() == pytest.approx(6)
    assert areas[5:9].sum() == pytest.approx(3)
    assert areas[9:].sum() == pytest.approx(3)
    assert mesh.faces[9:].tolist() == [[11, 12, 13], [11, 13, 8], [11, 8, 9], [11, 9, 10]]  # its fan is inside


def test_convex_polygons_that_are_not_flat_stay_fans(tmp_path):
    suffix, encode = FORMATS["off"]
    rng = np.random.default_rng(3)
    for size in (4, 5, 9):
        angles = np.sort(rng.uniform(0, 2 * np.pi, size) / size + 2 * np.pi * np.arange(size) / size)
        vertices = np.column_stack([np.cos(angles), np.sin(angles), 0.1 * rng.standard_normal(size)]) @ rotation(rng)
        faces = read_bytes(tmp_path, encode(vertices, [list(range(size))]), suffix).faces
        fan = [[0, 1, 2], [2, 3, 0]] if size == 4 else [[0, i, i + 1] for i in range(1, size - 1)]
        assert faces.tolist() == fan


@pytest.mark.parametrize("size", [4, 7, 12])
def test_random_star_shaped_polygons_that_are_not_flat_are_covered_once_in_projection(tmp_path, size):
    suffix, encode = FORMATS["off"]
    rng = np.random.default_rng(size)
    for _ in range(20):
        angles = 2 * np.pi * (np.arange(size) + rng.uniform(0, 0.9, size)) / size
        flat = rng.uniform(0.1, 1, size)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        vertices = np.column_stack([flat, 0.01 * rng.standard_normal(size)])
        mesh = read_bytes(tmp_path, encode(vertices, [list(range(size))]), suffix)
        in_plane = mesh.vertices * [1, 1, 0]
        assert face_areas(in_plane, mesh.faces).sum() == pytest.approx(shoelace(flat), rel=0.02)


def test_a_polygon_without_area_or_with_infinite_corners_is_left_to_the_checks_of_the_mesh(tmp_path):
    suffix, encode = FORMATS["off"]
    for corners in (
        [[0, 0, 0], [1, 0, 0], [3, 0, 0], [2, 0, 0]],
        [[0, 0, 0], [np.inf, 0, 0], [1, 1, 0], [0, np.nan, 0]],
    ):
        mesh = read_bytes(tmp_path, encode(np.array(corners, dtype=float), [[0, 1, 2, 3]]), suffix)
        assert mesh.faces.tolist() == [[0, 1, 2], [2, 3, 0]]


CROSSING = {
    "bow-tie": [[0, 0], [1, 1], [1, 0], [0, 1]],
    "bow-tie of two sizes": [[0, 0], [3, 3], [3, 0], [0, 1]],
    "pentagram": [[np.cos(4 * np.pi * i / 5), np.sin(4 * np.pi * i / 5)] for i in range(5)],
    "folded band": [[0, 0], [4, 0], [4, 1], [2, -1], [1, 2], [0, 1]],
}


@pytest.mark.parametrize("fmt", POLYGON_FORMATS)
@pytest.mark.parametrize("name", CROSSING)
def test_a_polygon_that_crosses_itself_becomes_a_fan_with_a_note(tmp_path, fmt, name):
    suffix, encode = FORMATS[fmt]
    size = len(CROSSING[name])
    crossing = np.column_stack([CROSSING[name], np.zeros(size)]) @ rotation(np.random.default_rng(5))
    vertices = np.vstack([crossing, crossing + 10])
    mesh = read_bytes(tmp_path, encode(vertices, [list(range(size))]), suffix)
    assert mesh.faces.tolist() == ([[0, 1, 2], [2, 3, 0]] if size == 4 else [[0, i, i + 1] for i in range(1, size - 1)])
    assert "1 face crosses itself: it became a fan, whose triangles overlap" in mesh.notes
    twice = read_bytes(tmp_path, encode(vertices, [list(range(size)), list(range(size, 2 * size))]), suffix)
    assert "2 faces cross themselves: they became fans, whose triangles overlap" in twice.notes


@pytest.mark.parametrize("name", CONCAVE)
def test_a_concave_polygon_is_not_said_to_cross_itself(tmp_path, name):
    suffix, encode = FORMATS["off"]
    rng = np.random.default_rng(9)
    vertices = np.column_stack([CONCAVE[name], 0.01 * rng.standard_normal(len(CONCAVE[name]))]) @ rotation(rng)
    mesh = read_bytes(tmp_path, encode(vertices, [list(range(len(vertices)))]), suffix)
    assert not [note for note in mesh.notes if "cross" in note]
