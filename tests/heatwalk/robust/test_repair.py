import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from heatwalk.meshes import MeshError, check_mesh
from heatwalk.robust.repair import Repair, repaired
from perturb import Holes, NormalNoise, ShotNoise, as_trimesh
from perturb.testing import odd_meshes
from tests.heatwalk.robust.meshes import arrays, blob, with_tube

ODD = odd_meshes()


@pytest.fixture(scope="module")
def damaged():
    """Holes, noise, spikes and a thin handle."""
    mesh = blob(5)
    start, end = int(mesh.vertices[:, 1].argmax()), int(mesh.vertices[:, 1].argmin())
    mesh = with_tube(mesh, start, end, 6)
    steps = [Holes(amount=0.02, unit="share_of_triangles"), NormalNoise(amount=0.3)]
    steps.append(ShotNoise(amount=0.01, height=0.1, height_unit="bounding_box_diagonal"))
    rng = np.random.default_rng(0)
    for step in steps:
        mesh = step(mesh, rng).mesh
    return arrays(mesh)


def test_a_clean_mesh_is_returned_as_it_is():
    vertices, faces = arrays(blob())
    repair = repaired(vertices, faces)
    assert np.array_equal(repair.vertices, vertices)
    assert np.array_equal(repair.faces, faces)
    assert set(repair.report.values()) == {0}


def test_everything_that_is_wrong_is_repaired_and_counted(damaged):
    repair = repaired(*damaged)
    assert repair.report["handles_cut"] == 1
    assert repair.report["holes_filled"] > 100
    assert repair.report["vertices_moved"] >= 90
    assert repair.report["sweeps"] > 0
    mesh = as_trimesh(repair.vertices, repair.faces)
    assert mesh.is_watertight
    assert mesh.area == pytest.approx(blob(5).area, rel=0.03)
    assert mesh.volume == pytest.approx(blob(5).volume, rel=0.03)


def test_without_any_repair_nothing_changes(damaged):
    vertices, faces = damaged
    nothing = Repair(stitch=False, cut_handles=False, fill_holes=False, remove_spikes=False, fair=False)
    repair = repaired(vertices, faces, nothing)
    assert np.array_equal(repair.vertices, vertices)
    assert np.array_equal(repair.faces, faces)


def test_a_turned_scaled_and_renumbered_mesh_is_repaired_alike(damaged):
    vertices, faces = damaged
    rng, turn = np.random.default_rng(1), Rotation.from_rotvec([0.3, -1.1, 0.7])
    number = rng.permutation(len(vertices))
    moved = np.empty_like(vertices)
    moved[number] = 1e-3 * turn.apply(vertices)
    here, there = repaired(vertices, faces), repaired(moved, rng.permutation(number[faces]))
    assert there.report == here.report
    assert there.vertices[number] == pytest.approx(1e-3 * turn.apply(here.vertices[: len(vertices)]), abs=1e-10)
    assert len(there.vertices) == len(here.vertices)
    assert len(there.faces) == len(here.faces)


@pytest.mark.parametrize("name", ODD)
def test_odd_meshes_keep_their_vertices_and_can_still_be_segmented(name):
    vertices, faces = arrays(ODD[name])
    repair = repaired(vertices, faces)
    assert np.isfinite(repair.vertices).all()
    assert len(repair.vertices) >= len(vertices)
    assert np.isin(np.unique(faces), repair.faces).all()
    assert np.isin(np.arange(len(vertices), len(repair.vertices)), repair.faces).all()
    try:
        check_mesh(vertices, faces)
    except MeshError:
        return
    check_mesh(repair.vertices, repair.faces)


def test_edges_of_more_than_two_faces_are_counted_and_left_alone():
    vertices, faces = arrays(blob(2))
    fin = np.array([[*faces[0, :2], len(vertices)], [*faces[50, 1:], len(vertices)]])
    vertices = np.concatenate([vertices, [[9.0, 0, 0]]])
    repair = repaired(vertices, np.concatenate([faces, fin]), Repair(remove_spikes=False, fair=False))
    assert repair.report["nonmanifold_edges"] == 2
    assert np.array_equal(repair.faces[: len(faces) + 2], np.concatenate([faces, fin]))


@pytest.mark.parametrize(
    ("option", "value"), [("max_hole", -1.0), ("strength", float("nan")), ("max_sweeps", 1.5), ("max_handle", -0.1)]
)
def test_an_option_out_of_range_is_named(option, value):
    with pytest.raises(ValueError, match=option):
        Repair(**{option: value})
