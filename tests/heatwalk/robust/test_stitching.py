import numpy as np
import trimesh

from heatwalk.robust.stitching import stitch_borders


def cube():
    box = trimesh.creation.box()
    return np.array(box.vertices), np.array(box.faces)


def test_a_soup_is_closed_again_whatever_the_order_of_its_faces():
    vertices, faces = cube()
    rng = np.random.default_rng(0)
    for _ in range(5):
        corners = vertices[rng.permutation(faces)].reshape(-1, 3)
        soup = np.arange(len(corners)).reshape(-1, 3)
        stitched = stitch_borders(corners, soup)
        assert len(stitched.origin) == 8
        assert trimesh.Trimesh(corners[stitched.origin], stitched.faces, process=False).is_watertight
        assert np.array_equal(corners[stitched.origin][stitched.number], corners)
        assert np.array_equal(stitched.number[soup], stitched.faces)
        assert np.array_equal(stitched.origin, [np.flatnonzero(stitched.number == i)[0] for i in range(8)])


def test_zeros_of_both_signs_are_one_position():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, 0], [1, 0, -0.0], [0, -1, 0]])
    stitched = stitch_borders(vertices, np.array([[0, 1, 2], [4, 3, 5]]))
    assert stitched.faces.tolist() == [[0, 1, 2], [1, 0, 3]]
    assert stitched.origin.tolist() == [0, 1, 2, 5]


def test_closed_surfaces_that_touch_stay_apart():
    vertices, faces = cube()
    both = np.vstack([vertices, vertices + np.eye(3)[0]])
    assert len(np.unique(both, axis=0)) == 12
    stitched = stitch_borders(both, np.vstack([faces, faces + 8]))
    assert np.array_equal(stitched.origin, np.arange(16))


def test_positions_that_differ_by_rounding_are_left_to_whoever_reads_the_file():
    vertices, faces = cube()
    corners = vertices[faces].reshape(-1, 3)
    corners[0] *= 1 + 1e-15
    stitched = stitch_borders(corners, np.arange(36).reshape(-1, 3))
    assert len(stitched.origin) == 9


def test_a_mesh_without_seams_is_left_as_it_is():
    vertices, faces = cube()
    for some in (faces, faces[2:]):
        stitched = stitch_borders(vertices, some)
        assert stitched.faces is some
        assert np.array_equal(stitched.number, np.arange(8))
