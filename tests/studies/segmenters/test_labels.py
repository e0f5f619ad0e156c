import numpy as np
import pytest
import trimesh

from studies.segmenters import LabelError, labels_at_vertices
from tests.helpers.meshes import bundled


@pytest.fixture(scope="module")
def cow():
    """Slightly asymmetric: no two areas are equal."""
    mesh = bundled("cow")
    return mesh.vertices + np.random.default_rng(0).normal(0, 1e-3, mesh.vertices.shape), np.asarray(mesh.faces)


def by_brute_force(labels, vertices, faces):
    areas = trimesh.Trimesh(vertices, faces, process=False).area_faces
    result = []
    for vertex in range(len(vertices)):
        around = (faces == vertex).any(axis=1)
        shares = {label: areas[around & (labels == label)].sum() for label in np.unique(labels[around])}
        result.append(min(shares, key=lambda label: (-shares[label], label), default=-1))
    return np.array(result)


def test_labels_of_vertices_stay_as_they_are(cow):
    labels = np.arange(len(cow[0]), dtype=np.uint16) % 7
    assert (labels_at_vertices(labels, *cow) == labels).all()


def test_a_vertex_gets_the_label_of_most_of_the_area_around_it(cow):
    labels = np.random.default_rng(1).integers(-1, 4, len(cow[1]))
    assert (labels_at_vertices(labels, *cow) == by_brute_force(labels, *cow)).all()


def test_labels_may_be_any_numbers(cow):
    labels = np.random.default_rng(2).integers(0, 5, len(cow[1]))
    names = np.array([40, 3, 700, 0, 12])
    assert (labels_at_vertices(names[labels], *cow) == names[labels_at_vertices(labels, *cow)]).all()


def test_a_tie_goes_to_the_smaller_label_and_a_vertex_without_faces_gets_the_background():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [5, 5, 5]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    assert labels_at_vertices([8, 2], square, faces).tolist() == [2, 8, 2, 2, -1]


def test_with_as_many_vertices_as_faces_the_option_decides_what_the_labels_belong_to():
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    with pytest.raises(LabelError, match="specify what the labels belong to"):
        labels_at_vertices([0, 1, 2, 3], corner, faces)
    assert labels_at_vertices([0, 1, 2, 3], corner, faces, "vertices").tolist() == [0, 1, 2, 3]
    by_area = labels_at_vertices([0, 1, 2, 3], corner, faces, "faces")
    assert by_area.tolist() == [0, 3, 3, 3]  # the last face is the largest


@pytest.mark.parametrize(
    ("labels", "labels_of", "message"),
    [
        (np.zeros(9, dtype=int), "auto", r"9 labels for 2903 vertices and 5804 faces; needed: 2903 or 5804"),
        (np.zeros(5804, dtype=int), "vertices", r"5804 labels .* needed: 2903$"),
        (np.zeros(2903), "auto", "type float64"),
        (np.zeros((2903, 1), dtype=int), "auto", r"shape \(2903, 1\)"),
        (np.full(2903, -2), "auto", "the label -2"),
    ],
)
def test_labels_of_another_number_shape_or_type_are_refused(labels, labels_of, message, cow):
    with pytest.raises(LabelError, match=message):
        labels_at_vertices(labels, *cow, labels_of)
