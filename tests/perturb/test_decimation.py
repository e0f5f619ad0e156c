"""Decimation: what remains, and what becomes of each vertex."""

from collections import Counter

import numpy as np
import pymeshlab
import pytest
import trimesh
from scipy.cluster.hierarchy import DisjointSet
from scipy.spatial.distance import cdist
from trimesh.graph import connected_components

import perturb
from perturb.decimation import _find_folded
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

BACKENDS = ["fast_simplification", "pymeshlab"]


def decimate(mesh, share, backend="fast_simplification"):
    return perturb.Decimation(share, backend=backend)(mesh, rng())


@pytest.fixture(scope="module", params=["cow", 109, 203])  # fast-simplification folds the cow and 109
def mesh(request):
    return bundled("cow") if request.param == "cow" else request.getfixturevalue("psb_mesh")(request.param)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("share", [0.5, 0.1])
def test_the_requested_share_of_faces_is_kept(mesh, share, backend):
    result = decimate(mesh, share, backend)
    target = round(share * len(mesh.faces))
    dropped = result.applied["folded_triangles_removed"]
    # A collapse inside a closed surface takes two faces at once.
    assert target - 1 <= len(result.mesh.faces) + dropped <= target + 1
    assert result.applied["share_of_faces_kept"] == len(result.mesh.faces) / len(mesh.faces)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("share", [0.5, 0.02])
def test_no_face_is_degenerate_and_no_two_are_equal(mesh, share, backend):
    faces = np.sort(decimate(mesh, share, backend).mesh.faces, axis=1)
    assert (np.diff(faces, axis=1) > 0).all()
    assert len(np.unique(faces, axis=0)) == len(faces)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_shape_remains_closed_and_oriented_and_keeps_its_volume(backend):
    mesh = bundled("cow")
    result = decimate(mesh, 0.25, backend).mesh
    assert result.is_watertight
    assert result.is_winding_consistent
    assert result.volume == pytest.approx(mesh.volume, rel=0.01)


@pytest.mark.parametrize("share", [0.5, 0.1, 0.02])
def test_faces_are_the_original_ones_with_corners_renamed_by_the_counterparts(mesh, share):
    """Collapsing edges renames corners; a face vanishes if two of its corners get the same name."""
    result = decimate(mesh, share)
    renamed = result.counterpart[mesh.faces]
    a, b, c = renamed.T
    renamed = renamed[(a != b) & (b != c) & (c != a)]
    result_faces = np.asarray(result.mesh.faces)
    renamed = renamed[~_find_folded(renamed)]

    def from_smallest(faces):
        return Counter(tuple(np.roll(face, -face.argmin())) for face in faces)

    assert from_smallest(result_faces) == from_smallest(renamed)


def test_vertices_with_the_same_counterpart_are_connected(mesh):
    counterpart = decimate(mesh, 0.1).counterpart.tolist()
    merged = DisjointSet(range(len(mesh.vertices)))
    for a, b in mesh.edges_unique.tolist():
        if counterpart[a] == counterpart[b]:
            merged.merge(a, b)
    assert merged.n_subsets == len(set(counterpart))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("share", [0.5, 0.1])
def test_counterparts_are_near(mesh, share, backend):
    result = decimate(mesh, share, backend)
    assert (result.counterpart >= 0).all()
    offset = result.mesh.vertices[result.counterpart] - mesh.vertices
    assert np.linalg.norm(offset, axis=1).mean() < result.mesh.edges_unique_length.mean()


def test_pymeshlab_counterparts_are_the_nearest_vertices():
    mesh = bundled("cow")
    result = decimate(mesh, 0.2, "pymeshlab")
    distance = cdist(mesh.vertices, result.mesh.vertices)
    offset = np.linalg.norm(result.mesh.vertices[result.counterpart] - mesh.vertices, axis=1)
    np.testing.assert_allclose(offset, distance.min(axis=1), atol=1e-12 * mesh.scale)
    assert result.applied["counterpart_by"] == "nearest_vertex"
    assert decimate(mesh, 0.2).applied["counterpart_by"] == "collapses"


@pytest.mark.parametrize("backend", BACKENDS)
def test_vertices_without_faces_are_removed(backend):
    cow = bundled("cow")
    vertices = np.insert(np.asarray(cow.vertices), 100, [0.0, 0.0, 0.0], axis=0)
    with_unreferenced = trimesh.Trimesh(vertices, cow.faces + (cow.faces >= 100), process=False)
    result, plain = decimate(with_unreferenced, 0.3, backend), decimate(cow, 0.3, backend)
    assert result.counterpart[100] == -1
    np.testing.assert_array_equal(np.delete(result.counterpart, 100), plain.counterpart)
    np.testing.assert_array_equal(result.mesh.faces, plain.mesh.faces)


def test_a_component_that_folds_completely_is_removed():
    ant = bundled("ant")  # fifteen components
    result = decimate(ant, 0.1)
    removed = result.counterpart < 0
    whole = [part for part in connected_components(ant.edges_unique) if removed[part].any()]
    assert 0 < len(whole) < 15
    assert all(removed[part].all() for part in whole)
    assert result.applied["components_after"] == 15 - len(whole)


def test_pymeshlab_does_not_depend_on_what_it_ran_before():
    """Its filter remembers flags, so every flag that matters is set in each call."""
    cow = bundled("cow")
    first = decimate(cow, 0.3, "pymeshlab")
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(cow.vertices, cow.faces))
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=1000, preserveboundary=True, preservenormal=True, planarquadric=False
    )
    second = decimate(cow, 0.3, "pymeshlab")
    np.testing.assert_array_equal(second.mesh.faces, first.mesh.faces)


def test_folded_faces_cancel_and_of_repeated_ones_one_remains():
    faces = np.array(
        [
            [0, 1, 2],  # cancels with the next
            [1, 0, 2],
            [3, 4, 5],  # kept, its repetition is not
            [4, 5, 3],
            [6, 6, 7],  # degenerate
            [8, 9, 10],  # two of this orientation
            [9, 8, 10],  # and one of the other
            [10, 8, 9],
            [11, 13, 12],  # alone
        ]
    )
    np.testing.assert_array_equal(np.flatnonzero(~_find_folded(faces)), [2, 5, 8])
