"""Quantisation: onto which numbers coordinates are rounded, and what is merged."""

from fractions import Fraction

import numpy as np
import pytest

import perturb
from perturb import PerturbationError
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

ANT = bundled("ant")


def unmerged(mesh, bits, unit="bits"):
    return perturb.Quantisation(bits, unit, weld=False)(mesh, rng())


@pytest.mark.parametrize("bits", [3, 8, 16])
def test_every_coordinate_is_rounded_to_the_nearest_point_of_the_grid(bits):
    result = unmerged(ANT, bits)
    low, size = ANT.bounds[0], ANT.extents.max()
    for before, after in ((ANT.vertices[v].tolist(), result.mesh.vertices[v].tolist()) for v in range(0, 486, 20)):
        for axis in range(3):
            spacing = Fraction(size) / (2**bits - 1)
            nearest = round((Fraction(before[axis]) - Fraction(low[axis])) / spacing) * spacing + Fraction(low[axis])
            assert after[axis] == pytest.approx(float(nearest), abs=1e-14 * size)
    moved_by = np.abs(result.mesh.vertices - ANT.vertices)
    assert result.applied["largest_rounding"] == moved_by.max() <= 0.5 * (1 + 1e-9) * size / (2**bits - 1)
    assert result.applied["vertices_moved"] == np.count_nonzero(moved_by.any(axis=1))


def test_along_the_longest_side_there_are_at_most_that_many_values_and_both_ends_remain():
    mesh = unmerged(ANT, 5).mesh
    axis = ANT.extents.argmax()
    values = np.unique(mesh.vertices[:, axis])
    assert len(values) <= 2**5
    np.testing.assert_allclose([values[0], values[-1]], ANT.bounds[:, axis], rtol=1e-12)


def test_rounding_again_changes_nothing():
    once = unmerged(ANT, 9).mesh
    np.testing.assert_allclose(unmerged(once, 9).mesh.vertices, once.vertices, atol=1e-14 * ANT.scale)


@pytest.mark.parametrize(("bits", "dtype"), [(24, np.float32), (11, np.float16)])
def test_significand_bits_are_those_of_floating_point_numbers(bits, dtype):
    np.testing.assert_array_equal(
        unmerged(ANT, bits, "significand_bits").mesh.vertices, ANT.vertices.astype(dtype).astype(float)
    )


def test_vertices_that_coincide_are_merged_and_collapsed_faces_removed():
    rounded, welded = unmerged(ANT, 5), perturb.Quantisation(5)(ANT, rng())
    positions = [tuple(position) for position in rounded.mesh.vertices.tolist()]
    faces = [[positions[v] for v in face] for face in ANT.faces.tolist()]
    kept = [face for face in faces if len(set(face)) == 3]
    assert [[tuple(v) for v in triangle] for triangle in welded.mesh.triangles.tolist()] == kept
    remaining = {position for face in kept for position in face}
    assert len(welded.mesh.vertices) == len(remaining)
    expected = np.array([positions[v] in remaining for v in range(len(positions))])
    np.testing.assert_array_equal(welded.counterpart >= 0, expected)
    here = welded.mesh.vertices[welded.counterpart[expected]]
    np.testing.assert_array_equal(here, rounded.mesh.vertices[expected])
    assert welded.applied["faces_collapsed"] == len(faces) - len(kept) > 0
    assert welded.applied["vertices_merged"] == len(positions) - len(set(positions))


def test_vertices_without_faces_are_not_merged_with_others():
    mesh = perturb.as_trimesh(np.concatenate([ANT.vertices[:1], ANT.vertices]), ANT.faces + 1)
    result = perturb.Quantisation(16)(mesh, rng())
    assert len(result.mesh.vertices) == len(mesh.vertices)
    assert (result.mesh.faces == mesh.faces).all()


def test_a_grid_on_which_no_face_has_an_area_is_refused():
    vertices = np.concatenate([ANT.vertices, [[1e9 * ANT.scale, 0, 0]]])
    mesh = perturb.as_trimesh(vertices, np.concatenate([ANT.faces, [[0, 1, len(ANT.vertices)]]]))
    with pytest.raises(PerturbationError, match=r"with 10 bits no face has an area .* a vertex far away"):
        perturb.Quantisation(10)(mesh, rng())
