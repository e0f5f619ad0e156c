"""The trivial methods, and the random numbers of those that draw some."""

import numpy as np
import pytest
import trimesh
from scipy.sparse.csgraph import connected_components, floyd_warshall

from studies.segmenters import make_segmenter, voronoi
from studies.segmenters._random import random_generator
from studies.segmenters.one_segment import OneSegment
from studies.segmenters.voronoi import Voronoi
from studies.testing import check_segmenter, example_meshes

TORUS = example_meshes()["torus"]


class Drawn:
    """A generator that draws given faces, and keeps what it was asked for."""

    def __init__(self, *faces):
        self.faces = np.array(faces)

    def choice(self, n, size, replace, p):
        self.asked = (n, size, replace)
        self.p = p
        return self.faces[:size]


@pytest.fixture
def drawn(monkeypatch):
    """A function: faces -> the generator that draws them, instead of that of the mesh."""

    def draw(*faces):
        generator = Drawn(*faces)
        monkeypatch.setattr(voronoi, "random_generator", lambda vertices, faces: generator)
        return generator

    return draw


def test_cells_contain_the_faces_nearest_to_theirs_along_the_surface(drawn):
    seeds = (0, 130, 300, 444)
    drawn(*seeds)
    labels = Voronoi()(TORUS.vertices, TORUS.faces, n_segments=4)
    ways = np.full((len(TORUS.faces), len(TORUS.faces)), np.inf)
    for (i, j), edge in zip(TORUS.face_adjacency, TORUS.face_adjacency_edges, strict=True):
        middle = TORUS.vertices[edge].mean(axis=0)
        length = sum(np.linalg.norm(TORUS.triangles_center[face] - middle) for face in (i, j))
        ways[i, j] = ways[j, i] = length
    distances = floyd_warshall(ways)[list(seeds)]
    np.testing.assert_allclose(distances[labels, np.arange(len(labels))], distances.min(axis=0))
    assert labels[list(seeds)].tolist() == [0, 1, 2, 3]


def test_faces_are_drawn_by_area_without_repetition(drawn):
    generator = drawn(0, 1, 2)
    Voronoi()(TORUS.vertices, TORUS.faces, n_segments=3)
    assert generator.asked == (len(TORUS.faces), 3, False)
    np.testing.assert_allclose(generator.p, TORUS.area_faces / TORUS.area)


def test_there_are_as_many_connected_cells_as_it_is_told():
    for k in (1, 2, 7, 40):
        labels = Voronoi()(TORUS.vertices, TORUS.faces, n_segments=k)
        assert np.unique(labels).tolist() == list(range(k))
        i, j = TORUS.face_adjacency.T
        same = labels[i] == labels[j]
        inside = trimesh.graph.edges_to_coo(TORUS.face_adjacency[same], count=len(labels))
        assert connected_components(inside, directed=False)[0] == k


def test_a_component_without_a_drawn_face_belongs_to_the_first_cell(drawn):
    both = trimesh.util.concatenate([TORUS, TORUS.copy().apply_translation([9, 0, 0])])
    n = len(TORUS.faces)
    drawn(n + 3, n + 200)
    labels = Voronoi()(both.vertices, both.faces, n_segments=2)
    assert set(labels[:n]) == {0}
    assert set(labels[n:]) == {0, 1}


@pytest.mark.parametrize(
    ("faces", "cells"),
    [
        ([[0, 1, 2]], 1),  # fewer faces than cells
        ([[0, 1, 2], [3, 4, 5]], 2),  # a soup
        ([[0, 1, 1], [0, 2, 2]], 2),  # no area at all
        ([[0, 1, 2], [0, 1, 1]], 1),  # only faces with an area are drawn
    ],
)
def test_bad_meshes_have_cells_too(faces, cells):
    vertices = np.random.default_rng(1).random((6, 3))
    labels = Voronoi()(vertices, np.array(faces), n_segments=4)
    assert len(labels) == len(faces)
    assert len(np.unique(labels)) == cells


def test_one_segment_is_one_segment():
    assert OneSegment()(TORUS.vertices, TORUS.faces).tolist() == [0] * len(TORUS.faces)


@pytest.mark.parametrize("name", ["one_segment.OneSegment", "voronoi.Voronoi"])
def test_the_baselines_keep_to_the_contract_of_segmenters(name):
    check_segmenter(make_segmenter({"_target_": f"studies.segmenters.{name}"}))


def test_the_mesh_alone_determines_random_numbers():
    draws = random_generator(TORUS.vertices, TORUS.faces).random(5)
    copies = np.asfortranarray(TORUS.vertices), TORUS.faces.astype(np.int32)
    np.testing.assert_array_equal(random_generator(*copies).random(5), draws)


def test_any_change_of_the_mesh_changes_random_numbers():
    vertices, faces = np.array(TORUS.vertices), np.array(TORUS.faces)
    moved = vertices.copy()
    moved[5, 1] = np.nextafter(moved[5, 1], 9)
    draws = {
        random_generator(*mesh).random()
        for mesh in ((vertices, faces), (moved, faces), (vertices, faces[::-1]), (vertices, faces[:-1]))
    }
    assert len(draws) == 4
