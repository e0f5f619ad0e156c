import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from heatwalk.robust.repair import Repair, repaired
from heatwalk.robust.segmentation import segment_robust
from heatwalk.robust.welds import part_welds
from perturb import Welding, as_trimesh
from studies.metrics import change_percentage
from tests.heatwalk.robust.meshes import arrays, blob

N = 9  # vertices along each side of the slab


@pytest.fixture(scope="module")
def slab():
    """A closed slab; the diagonals of its two sides cross, so that no faces lie on each other where it is welded."""
    i, j = np.divmod(np.arange(N * N), N)
    vertices = np.column_stack([np.tile(i, 2), np.tile(j, 2), np.repeat([0.7, 0.0], N * N)]).astype(float)
    a = np.flatnonzero((i < N - 1) & (j < N - 1))
    top = np.concatenate([np.column_stack([a, a + N, a + N + 1]), np.column_stack([a, a + N + 1, a + 1])])
    bottom = np.concatenate([np.column_stack([a, a + 1, a + N]), np.column_stack([a + 1, a + N + 1, a + N])]) + N * N
    sides = trimesh.Trimesh(vertices, np.concatenate([top, bottom]), process=False)
    start, end = sides.edges[trimesh.grouping.group_rows(sides.edges_sorted, require_count=1)].T
    upper = start < N * N
    start, end = start[upper], end[upper]
    walls = [np.column_stack([end, start, start + N * N]), np.column_stack([end, start + N * N, end + N * N])]
    return as_trimesh(vertices, np.concatenate([top, bottom, *walls]))


@pytest.fixture(scope="module")
def welded(slab):
    """The slab pinched: nine vertices of its top merged with those below; faces as arrays."""
    vertices, faces = arrays(slab)
    i, j = np.divmod(np.arange(N * N), N)
    pinched = np.flatnonzero((abs(i - N // 2) <= 1) & (abs(j - N // 2) <= 1))
    vertices[pinched, 2] = 0.35
    number = np.arange(2 * N * N)
    number[pinched + N * N] = pinched
    number = np.unique(number, return_inverse=True)[1]
    merged = np.empty((number.max() + 1, 3))
    merged[number[::-1]] = vertices[::-1]
    return merged, number[faces]


def test_a_welded_surface_is_the_one_before_again(slab, welded):
    assert slab.is_watertight
    vertices, faces = welded
    mended, parted, count = part_welds(vertices, faces)
    assert count == 9
    assert np.array_equal(mended[parted], vertices[faces])
    pairs = np.unique(np.column_stack([parted.ravel(), slab.faces.ravel()]), axis=0)
    assert len(pairs) == len(mended) == len(slab.vertices)  # a bijection


def test_the_edges_of_a_weld_have_four_faces_and_two_afterwards(welded):
    sides = np.sort(welded[1][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert np.unique(sides, axis=0, return_counts=True)[1].max() == 4
    assert as_trimesh(*part_welds(*welded)[:2]).is_watertight


def test_the_report_counts_the_vertices_that_were_parted(welded):
    report = repaired(*welded).report
    assert (report["welds_parted"], report["nonmanifold_edges"], report["handles_cut"]) == (9, 12, 0)
    assert repaired(*welded, Repair(cut_handles=False)).report["welds_parted"] == 0


def test_ends_welded_together_are_segmented_as_before():
    ball = trimesh.creation.icosphere(3)
    x, y, z = Rotation.random(rng=np.random.default_rng(0)).apply(ball.vertices).T
    thick = 0.3 / np.sqrt(np.hypot(y, z))
    vertices = np.column_stack([(1 + thick * y) * np.cos(3 * x), (1 + thick * y) * np.sin(3 * x), thick * z])
    horseshoe = as_trimesh(vertices, ball.faces)
    welded = Welding(amount=0.02, where="external")(horseshoe, np.random.default_rng(0))
    before, after = (segment_robust(*arrays(mesh)).labels for mesh in (horseshoe, welded.mesh))
    assert change_percentage(before, after[welded.counterpart]) < 1
    assert welded.applied["pairs_merged"] > 5


def test_two_solids_that_touch_in_an_edge_stay_together():
    box = trimesh.creation.box()
    vertices = np.concatenate([box.vertices, box.vertices + np.array([1.0, 1.0, 0.0])])
    vertices, number = np.unique(vertices.round(9), axis=0, return_inverse=True)
    faces = number[np.concatenate([box.faces, box.faces + 8])]
    assert len(vertices) == 14
    mended, parted, count = part_welds(vertices, faces)
    assert count == 0
    assert np.array_equal(parted, faces)
    assert np.array_equal(mended, vertices)


def test_holes_that_touch_in_a_vertex_do_not_part_it():
    vertices, faces = arrays(blob())
    around = np.flatnonzero((faces == 100).any(axis=1))
    following = {faces[f][(c := list(faces[f]).index(100)) - 2]: (f, faces[f][c - 1]) for f in around}
    start = next(iter(following))
    ring = []
    while len(ring) < len(around):
        f, start = following[start]
        ring.append(f)
    pierced = np.delete(faces, [ring[0], ring[3]], axis=0)
    assert part_welds(vertices, pierced)[2] == 0


def test_a_clean_surface_is_returned_as_it_is():
    vertices, faces = arrays(blob())
    mended, parted, count = part_welds(vertices, faces)
    assert mended is vertices
    assert parted is faces
    assert count == 0
