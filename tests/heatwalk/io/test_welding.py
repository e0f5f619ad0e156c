import numpy as np
import pytest
import trimesh

import heatwalk
from heatwalk.io.welding import count_coincident, weld_vertices
from heatwalk.meshes import MeshError, inspect_mesh
from tests.helpers.mesh_files import FORMATS, off_bytes, read_bytes, stl_binary_bytes

SPHERE = trimesh.creation.icosphere(3)


def soup(mesh, jitter=0.0):
    """Three vertices of its own for every triangle, each moved by up to ``jitter``."""
    rng = np.random.default_rng(0)
    corners = np.asarray(mesh.triangles).reshape(-1, 3)
    return corners + jitter * rng.uniform(-1, 1, corners.shape), np.arange(len(corners)).reshape(-1, 3)


@pytest.mark.parametrize("scale", [1.0, 1e-200, 1e200])
@pytest.mark.parametrize("offset", [0.0, 1.0])
def test_coincident_vertices_are_counted_exactly_and_nearly(scale, offset):
    vertices, faces = soup(SPHERE)
    n = len(vertices)
    assert count_coincident((vertices + offset) * scale, faces) == (n, 0)
    vertices, faces = soup(SPHERE, jitter=1e-7)
    assert count_coincident((vertices + offset) * scale, faces) == (0, n)
    vertices, faces = soup(SPHERE, jitter=1e-3)
    assert count_coincident((vertices + offset) * scale, faces) == (0, 0)
    assert count_coincident((SPHERE.vertices + offset) * scale, SPHERE.faces) == (0, 0)


def test_near_vertices_are_those_of_a_search_tree():
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(1)
    vertices, faces = soup(SPHERE, jitter=2e-5)
    vertices = vertices @ np.linalg.qr(rng.standard_normal((3, 3)))[0]
    radius = 1e-5 * np.linalg.norm(np.ptp(vertices, axis=0))
    pairs = cKDTree(vertices).query_pairs(radius, output_type="ndarray")
    assert 0 < len(np.unique(pairs)) < len(vertices)
    assert count_coincident(vertices, faces) == (0, len(np.unique(pairs)))


def test_short_edges_and_meshes_that_are_small_beside_the_diagonal_are_not_near():
    vertices = np.vstack([SPHERE.vertices, [[1e7, 0, 0], [1e7, 1, 0], [1e7, 0, 1]]])
    n = len(SPHERE.vertices)
    assert count_coincident(vertices, np.vstack([SPHERE.faces, [[n, n + 1, n + 2]]])) == (0, 0)
    split = np.vstack([SPHERE.vertices, SPHERE.vertices[:1] * (1 + 1e-7)])
    faces = SPHERE.faces.copy()
    faces[np.argmax((faces == 0).any(axis=1))][0] = 0
    a, b, _ = next(f for f in SPHERE.faces.tolist() if 0 in f)
    assert count_coincident(split, np.vstack([faces, [[0, n, b if a == 0 else a]]])) == (0, 0)


def test_signs_of_zero_and_nan_do_not_matter():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, -0.0], [np.nan, 0, 0], [np.inf, 1, 0]])
    faces = np.array([[0, 1, 2], [3, 1, 2], [4, 5, 1]])
    assert count_coincident(vertices, faces) == (2, 0)
    assert len(weld_vertices(vertices, faces, "exact")[0]) == 5
    assert len(weld_vertices(vertices, faces, 1e-5)[0]) == 5


@pytest.mark.parametrize(("jitter", "weld"), [(0.0, "exact"), (0.0, 1e-9), (1e-7, 1e-5), (1e-7, 1e-3)])
def test_welding_restores_a_mesh_and_keeps_all_faces_in_their_order(jitter, weld):
    vertices, faces = weld_vertices(*soup(SPHERE, jitter), weld)
    assert len(vertices) == len(SPHERE.vertices)
    assert np.abs(vertices[faces] - SPHERE.triangles).max() <= jitter * 2
    report = inspect_mesh(vertices, faces)
    assert (report.n_components, report.is_watertight) == (1, True)


def test_nothing_is_welded_by_default_and_the_note_tells_how(tmp_path):
    vertices, faces = soup(SPHERE, 1e-7)
    vertices[:6] = vertices[6:12]
    mesh = read_bytes(tmp_path, off_bytes(vertices, faces), ".off")
    assert np.array_equal(mesh.vertices, vertices)
    exact, near = mesh.notes
    assert exact.startswith("12 of 3,840 vertices coincide exactly with another one")
    assert 'weld="exact" (--weld exact)' in exact
    assert near.startswith(
        f"{count_coincident(vertices, faces)[1]:,} of 3,840 vertices nearly coincide with another one"
    )
    assert "weld=1e-05 (--weld 1e-05)" in near
    assert heatwalk.read_mesh(tmp_path / "mesh.off", weld=1e-5).notes[0].startswith("welded 3,840 vertices into ")


@pytest.mark.parametrize("fmt", FORMATS)
def test_every_format_is_welded(tmp_path, fmt):
    suffix, encode = FORMATS[fmt]
    vertices, faces = soup(SPHERE, 1e-6)
    read_bytes(tmp_path, encode(vertices, faces.tolist() if encode is not stl_binary_bytes else faces), suffix)
    mesh = heatwalk.read_mesh(tmp_path / f"mesh{suffix}", weld=1e-5)
    assert len(mesh.vertices) == len(SPHERE.vertices)
    assert inspect_mesh(mesh.vertices, mesh.faces).is_watertight
    assert not [note for note in mesh.notes if "coincide" in note]


@pytest.mark.parametrize("weld", ["near", 0, -1e-5, 1, 2.0, np.nan, True, "1e-5"])
def test_a_value_that_is_no_way_to_weld_is_rejected(tmp_path, weld):
    (tmp_path / "a.off").write_bytes(off_bytes(SPHERE.vertices, SPHERE.faces))
    with pytest.raises(MeshError, match=r"a.off: weld=.* must be 'exact' or a positive number below 1"):
        heatwalk.read_mesh(tmp_path / "a.off", weld=weld)


def test_a_distance_that_would_merge_whole_regions_is_rejected():
    fine = trimesh.creation.icosphere(4)
    with pytest.raises(MeshError, match=r"weld=0.5 would merge whole regions of the mesh; choose a smaller distance"):
        weld_vertices(fine.vertices, fine.faces, 0.5)
