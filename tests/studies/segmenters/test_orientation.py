"""Faces turned over so that they agree on which side is outside."""

import numpy as np
import pytest
import trimesh

from perturb.testing import odd_meshes
from studies.segmenters._orientation import outward
from tests.helpers.beads import beads


def turned(faces, where):
    return np.where(where[:, None], faces[:, ::-1], faces)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4, 0.9, 1.0])
def test_a_closed_mesh_is_restored_whatever_share_of_its_faces_is_turned_over(share):
    mesh, _ = beads()
    where = np.random.default_rng(0).random(len(mesh.faces)) < share
    restored = outward(mesh.vertices, turned(mesh.faces, where))
    assert np.array_equal(np.sort(restored, axis=1), np.sort(mesh.faces, axis=1))
    result = trimesh.Trimesh(mesh.vertices, restored, process=False)
    assert result.is_winding_consistent
    assert result.volume == pytest.approx(mesh.volume, rel=1e-12)


def test_each_component_is_restored_on_its_own():
    balls = [trimesh.creation.icosphere(1).apply_translation([3 * i, 0, 0]) for i in range(3)]
    both = trimesh.util.concatenate(balls)
    where = np.repeat([True, False, True], 80)
    assert np.array_equal(outward(both.vertices, turned(both.faces, where)), turned(turned(both.faces, where), where))


def test_consistent_faces_of_an_open_surface_are_left_as_they_are():
    half = trimesh.creation.icosphere(2)
    flat = trimesh.Trimesh(half.vertices * [1, 1, 0], half.faces[half.triangles_center[:, 2] > 0], process=False)
    for faces in (flat.faces, flat.faces[:, ::-1]):
        assert np.array_equal(outward(flat.vertices, faces), faces)


def test_a_surface_with_one_side_is_left_as_it_is():
    mesh = odd_meshes()["Möbius strip"]
    assert np.array_equal(outward(mesh.vertices, mesh.faces), mesh.faces)
