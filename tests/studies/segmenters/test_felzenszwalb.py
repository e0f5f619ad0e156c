"""Graph-based segmentation of normals."""

import numpy as np
import pytest
import trimesh

from studies.segmenters.felzenszwalb import Felzenszwalb
from studies.testing import check_segmenter, example_meshes
from tests.helpers.peers import labels_or_reasons, same_partition, turned


def by_definition(vertices, faces, threshold, min_vertices):
    """Felzenszwalb and Huttenlocher's algorithm with sets of vertices, as the paper states it."""
    normals = np.zeros((len(vertices), 3))
    counts = np.zeros(len(vertices))
    for face in faces:
        a, b, c = vertices[face]
        normal = np.cross(b - a, c - a)
        for vertex in face:
            normals[vertex] += normal / np.linalg.norm(normal)
            counts[vertex] += 1
    normals /= counts[:, None]
    weights = {}
    for a, b in sorted({tuple(sorted((face[i], face[i - 1]))) for face in faces for i in range(3)}):
        weight = 1 - normals[a] @ normals[b]
        diverge = (normals[b] - normals[a]) @ (vertices[b] - vertices[a]) > 0
        weights[a, b] = weight**2 if diverge else weight
    region = {vertex: frozenset([vertex]) for vertex in range(len(vertices))}
    largest = dict.fromkeys(region.values(), 0.0)

    def join(a, b, weight):
        union = region[a] | region[b]
        largest[union] = weight
        region.update(dict.fromkeys(union, union))

    ordered = sorted(weights, key=weights.get)
    for a, b in ordered:
        limit = min(largest[region[end]] + threshold / len(region[end]) for end in (a, b))
        if region[a] != region[b] and weights[a, b] <= limit:
            join(a, b, weights[a, b])
    for a, b in ordered:
        if region[a] != region[b] and min(len(region[a]), len(region[b])) < min_vertices:
            join(a, b, 0.0)
    return [min(region[vertex]) for vertex in range(len(vertices))]


@pytest.fixture(scope="module")
def box():
    mesh = trimesh.creation.box((1, 2, 3)).subdivide_to_size(0.2)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


@pytest.mark.parametrize("name", ["ellipsoid", "torus", "open"])
@pytest.mark.parametrize(("threshold", "min_vertices"), [(0.01, 20), (0.1, 1), (0.003, 5)])
def test_the_regions_are_those_of_the_definition(name, threshold, min_vertices):
    mesh = example_meshes()[name]
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    labels = Felzenszwalb(threshold, min_vertices)(vertices, faces)
    assert same_partition(labels, by_definition(vertices, faces, threshold, min_vertices))


def test_the_sides_of_a_box_are_regions(box):
    vertices, faces = box
    labels = Felzenszwalb(threshold=1e-3, min_vertices=20)(vertices, faces)
    assert len(np.unique(labels)) == 6
    # A vertex inside a side belongs to the region of that side.
    normal = np.abs(np.abs(vertices) - np.array([0.5, 1, 1.5])) < 1e-9
    inside = normal.sum(axis=1) == 1
    side = np.where(normal, np.sign(vertices) * [1, 2, 3], 0).sum(axis=1)
    assert same_partition(labels[inside], side[inside])


def test_every_region_has_the_fewest_vertices_asked_for():
    mesh = example_meshes()["torus"]
    fewest = [np.bincount(Felzenszwalb(1e-4, count)(mesh.vertices, mesh.faces)).min() for count in (1, 5, 40)]
    assert all(found >= count for found, count in zip(fewest, (1, 5, 40), strict=True))


def test_place_direction_and_size_do_not_matter():
    mesh = example_meshes()["ellipsoid"]
    labels = Felzenszwalb()(mesh.vertices, mesh.faces)
    assert len(np.unique(labels)) > 1
    assert same_partition(labels, Felzenszwalb()(turned(np.asarray(mesh.vertices)), mesh.faces))


def test_it_keeps_to_the_contract_of_segmenters():
    check_segmenter(Felzenszwalb(), labels_of="vertices")


def test_odd_meshes_have_labels():
    results = labels_or_reasons(Felzenszwalb())
    assert not [reason for reason in results.values() if isinstance(reason, str)]
    soup = results["soup"].reshape(-1, 3)
    assert (soup == soup[:, :1]).all()
    assert len(np.unique(soup)) == len(soup)
    assert same_partition(results["size 1e-6"], results["size 1e6"])
    assert same_partition(results["size 1e-200"], results["size 1e200"])
    unreferenced = results["unreferenced vertices"]
    assert (unreferenced[: len(unreferenced) - 642] == -1).all()
    assert (unreferenced[-642:] >= 0).all()


def test_coordinates_that_are_not_finite_are_named():
    vertices = np.eye(3)
    vertices[1, 2] = np.nan
    with pytest.raises(ValueError, match="vertex 1 has NaN or infinite coordinates"):
        Felzenszwalb()(vertices, np.array([[0, 1, 2]]))
    with pytest.raises(ValueError, match="the mesh has no faces"):
        Felzenszwalb()(vertices, np.zeros((0, 3), dtype=int))


@pytest.mark.parametrize(
    ("options", "message"),
    [({"threshold": -1}, r"segmenter\.threshold is -1: "), ({"min_vertices": 0}, r"segmenter\.min_vertices is 0: ")],
)
def test_impossible_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        Felzenszwalb(**options)
