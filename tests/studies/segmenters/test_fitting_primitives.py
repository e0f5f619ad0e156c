"""Hierarchical segmentation by fitting primitives."""

import numpy as np
import pytest
import trimesh

from studies.segmenters._dual_graph import DualGraph
from studies.segmenters._primitives import primitive_errors
from studies.segmenters.fitting_primitives import FittingPrimitives, moments_of
from studies.testing import check_segmenter
from tests.helpers.peers import labels_or_reasons, same_partition, turned


def errors(mesh):
    """Mean squared distances from plane, sphere and cylinder, over the area."""
    corners, areas = np.asarray(mesh.triangles), np.asarray(mesh.area_faces)
    normals = np.einsum("m,mi,mj->ij", areas, mesh.face_normals, mesh.face_normals)
    return np.array(primitive_errors(moments_of(corners, areas).sum(axis=0), normals, np.empty((3, 3)))) / areas.sum()


def moved(mesh):
    """The mesh in another place and direction, of the same size."""
    vertices = turned(np.asarray(mesh.vertices)) / 7.3
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def side_of_cylinder(sections=64):
    can = trimesh.creation.cylinder(0.5, 2.0, sections=sections)
    return trimesh.Trimesh(can.vertices, can.faces[np.abs(can.face_normals[:, 2]) < 0.5], process=False)


def test_moments_are_exact_integrals():
    # Over the triangle (0, 0), (1, 0), (0, 1) the integral of x^a y^b is a! b! / (a + b + 2)!
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    (moments,) = moments_of(corners, np.array([0.5]))
    assert moments[0, [0, 1, 4, 7]] == pytest.approx([1 / 2, 1 / 6, 1 / 12, 1 / 24])
    assert moments[4, [1, 4, 7, 5]] == pytest.approx([1 / 20, 1 / 30, 6 / 720, 4 / 720])
    assert not moments[3].any()


@pytest.mark.parametrize("change", [lambda mesh: mesh, moved])
def test_each_primitive_fits_its_own_shape_and_no_other(change):
    plane = errors(change(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0]], [[0, 1, 2], [0, 2, 3]])))
    ball = errors(change(trimesh.creation.icosphere(4, 0.5)))
    can = errors(change(side_of_cylinder()))
    assert [each.argmin() for each in (plane, ball, can)] == [0, 1, 2]
    assert plane[0] < 1e-15
    # A polyhedron is off by its facets alone.
    assert ball[1] < 1e-6
    assert can[2] < 1e-6
    assert ball[0] == pytest.approx(0.25 / 3, rel=0.01)  # the variance of a coordinate on the sphere
    assert can[0] == pytest.approx(0.125, rel=0.01)


def test_a_can_has_a_side_and_two_ends():
    can = trimesh.creation.cylinder(1.0, 3.0, sections=48)
    labels = FittingPrimitives()(can.vertices, can.faces, 3)
    assert same_partition(labels, np.round(can.face_normals[:, 2]))


def test_a_box_has_six_sides():
    box = trimesh.creation.box((1, 2, 3)).subdivide_to_size(0.5)
    labels = FittingPrimitives()(box.vertices, box.faces, 6)
    assert same_partition(labels, np.round(box.face_normals @ [1, 2, 3]))


def test_regions_of_fewer_segments_are_unions_of_those_of_more():
    mesh = trimesh.creation.torus(1.0, 0.4, major_sections=16, minor_sections=16)
    mesh.vertices += 0.1 * np.sin(3 * mesh.vertices[:, ::-1])
    fine, coarse = (FittingPrimitives()(mesh.vertices, mesh.faces, n) for n in (9, 4))
    assert [len(np.unique(labels)) for labels in (fine, coarse)] == [9, 4]
    assert all(len(np.unique(coarse[fine == label])) == 1 for label in range(9))
    assert same_partition(fine, DualGraph.of(mesh.vertices, mesh.faces).components(fine))


def test_a_concave_border_keeps_regions_apart():
    # A ridge of 20 degrees and a valley of 10: flatter, but where parts meet.
    x, z = np.array([0, 1, 2, 3.0]), np.tan(np.radians([10, -10, 0]))
    strip = np.array([[x[i], y, np.r_[0, z.cumsum()][i]] for i in range(4) for y in (0.0, 1)])
    faces = [[2 * i + a, 2 * i + b, 2 * i + c] for i in range(3) for a, b, c in ((0, 2, 1), (1, 2, 3))]
    sheet = trimesh.Trimesh(strip, faces, process=False).subdivide().subdivide()
    part = np.minimum(sheet.triangles_center[:, 0].astype(int), 2)
    assert same_partition(FittingPrimitives()(sheet.vertices, sheet.faces, 2), part == 2)
    assert same_partition(FittingPrimitives(concavity=0)(sheet.vertices, sheet.faces, 2), part == 0)


@pytest.mark.parametrize("concavity", [-1.0, np.inf, np.nan])
def test_concavity_is_not_negative(concavity):
    with pytest.raises(ValueError, match=r"segmenter\.concavity is .* at least 0 and finite"):
        FittingPrimitives(concavity=concavity)


def test_place_direction_and_size_do_not_matter():
    mesh = trimesh.creation.icosphere(2)
    vertices = np.asarray(mesh.vertices) * [2, 1, 0.7] + 0.1 * np.sin(3 * np.asarray(mesh.vertices)[:, ::-1] + 1)
    labels, again = (FittingPrimitives()(points, mesh.faces, 5) for points in (vertices, turned(vertices)))
    assert same_partition(labels, again)


def test_it_keeps_to_the_contract_of_segmenters():
    check_segmenter(FittingPrimitives(), labels_of="faces")


def test_odd_meshes_have_as_many_regions_as_told_or_as_they_have_components():
    method = FittingPrimitives()
    told = lambda vertices, faces: method(vertices, faces, 5)  # noqa: E731
    told.labels_of = "faces"
    results = labels_or_reasons(told)
    assert {len(np.unique(labels)) for name, labels in results.items() if name not in MORE} == {5}
    assert all(len(np.unique(results[name])) == number for name, number in MORE.items())


# Components that share no edge.
MORE = {"soup": 1280, "specks": 21}


def test_no_more_regions_than_faces():
    corner = np.eye(3), np.array([[0, 1, 2]])
    assert FittingPrimitives()(*corner, 5).tolist() == [0]
