import numpy as np
import trimesh

from studies.figures.scenes import reduce_mesh


def test_a_mesh_of_few_faces_is_shown_as_it_is():
    box = trimesh.creation.box()
    reduced = reduce_mesh(box.vertices, box.faces, 12)
    np.testing.assert_array_equal(reduced.source[reduced.faces], box.faces)


def test_a_reduced_mesh_consists_of_vertices_of_the_mesh_and_keeps_its_shape():
    bean = trimesh.creation.icosphere(4).apply_scale([3, 1, 2]).apply_translation([500, 0, 0])
    reduced = reduce_mesh(bean.vertices, bean.faces, 800)
    shown = reduced.surface(np.asarray(bean.vertices))
    assert 700 < len(reduced.faces) <= 800
    np.testing.assert_array_equal(shown.vertices, bean.vertices[reduced.source])
    np.testing.assert_array_equal(np.unique(reduced.faces), np.arange(len(reduced.source)))
    mesh = trimesh.Trimesh(shown.vertices, shown.faces, process=False)
    assert 0.96 < mesh.volume / bean.volume < 1.0  # its vertices are on a convex surface


def test_vertices_that_no_face_uses_are_left_out():
    reduced = reduce_mesh(np.eye(4)[:, :3], np.array([[0, 1, 3]]))
    assert reduced.source.tolist() == [0, 1, 3]
    assert reduced.faces.tolist() == [[0, 1, 2]]
