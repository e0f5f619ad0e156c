"""Every shape: its surface, its parts, and that nothing touches that is not joined."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from heatwalk import inspect_mesh
from studies.datasets import DatasetError
from studies.datasets.synthetic import Synthetic
from studies.datasets.synthetic.shapes import SHAPES
from studies.datasets.synthetic.skeleton import Plate, Shape, Tube
from studies.datasets.synthetic.surface import field_of, labelled, make_mesh

HANDLES = {"cup": 1, "chair": 4}  # a handle; a window between seat and rail, and three between the spindles
LOW = 1000
MODELS = Synthetic(resolution=LOW).models()
QUICK = {*SHAPES, "quadruped-2", "hand-2"}


def each(models):
    """All rest poses, and some of the others; the rest is slow."""
    marks = {False: [pytest.mark.slow], True: []}
    return [pytest.param(model, id=model.name, marks=marks[model.name in QUICK]) for model in models]


@pytest.fixture(scope="module", params=each(MODELS))
def model(request):
    return request.param


@pytest.fixture(scope="module")
def mesh(model):
    loaded = model.load()
    return trimesh.Trimesh(loaded.vertices, loaded.faces, process=False)


@pytest.fixture(scope="module")
def labels(model):
    [labels] = model.human_segmentations()
    return labels


def test_there_are_twelve_shapes():
    assert list(SHAPES) == [
        "biped", "quadruped", "hand", "octopus", "bird", "fish", "chair", "cup", "pliers", "tree", "star", "snake",
    ]  # fmt: skip


def test_the_surface_is_closed_oriented_outwards_and_of_one_piece_with_its_handles(model, mesh):
    edges = np.sort(mesh.edges, axis=1)
    distinct, counts = np.unique(edges, axis=0, return_counts=True)
    directed = np.unique(mesh.edges, axis=0)
    assert np.all(counts == 2)
    assert len(directed) == len(mesh.edges)  # each edge once in each direction
    assert mesh.volume > 0
    assert mesh.body_count == 1
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)
    genus = (2 - (len(mesh.vertices) - len(distinct) + len(mesh.faces))) / 2
    assert genus == HANDLES.get(model.category, 0)


def test_the_mesh_has_about_the_vertices_that_were_asked_for_and_good_triangles(mesh):
    assert len(mesh.vertices) == pytest.approx(LOW, rel=0.15)
    lengths = mesh.edges_unique_length
    assert lengths.std() < 0.2 * lengths.mean()
    assert np.degrees(np.quantile(mesh.face_angles, 0.01)) > 30
    report = inspect_mesh(mesh.vertices, mesh.faces)
    assert report.problem is None
    assert report.n_degenerate_faces == 0


def test_every_vertex_is_where_the_sum_of_the_limbs_exponentials_is_one(model, mesh):
    """Evaluated without the field: over all pieces, without limits of reach."""
    shape = SHAPES[model.category]
    chosen = mesh.vertices[::7]
    total = np.zeros(len(chosen))
    for solid in shape.solids(model.pose):
        distance, _ = solid.nearest(chosen[:, None], np.arange(len(solid.parts)))
        total += np.exp(-distance.min(axis=1) / shape.blend)
    assert np.abs(shape.blend * np.log(total)).max() < 4e-4 * shape.blend


def test_a_face_belongs_to_the_part_whose_balls_are_nearest(model, mesh, labels):
    """Evaluated without the field: the least over all pieces, without limits of reach."""
    shape = SHAPES[model.category]
    chosen = np.arange(0, len(mesh.faces), 11)
    centres = mesh.triangles_center[chosen]
    distances = np.full((len(chosen), len(shape.parts)), np.inf)
    for solid in shape.solids(model.pose):
        distance, _ = solid.nearest(centres[:, None], np.arange(len(solid.parts)))
        for piece, part in enumerate(solid.parts):
            distances[:, part] = np.minimum(distances[:, part], distance[:, piece])
    assert np.all(distances[np.arange(len(chosen)), labels[chosen]] <= distances.min(axis=1) + 2e-9)


def test_every_part_is_one_region(model, mesh, labels):
    assert set(labels) == set(range(len(model.parts)))
    for part, name in enumerate(model.parts):
        faces = mesh.faces[labels == part]
        edges = np.vstack([faces[:, :2], faces[:, 1:]])
        matrix = coo_array((np.ones(len(edges)), edges.T), shape=(len(mesh.vertices),) * 2)
        components = connected_components(matrix, directed=False)[1]
        assert len(np.unique(components[faces])) == 1, name


def test_parts_border_on_each_other_only_where_the_skeleton_joins_them(model, mesh, labels):
    shape = SHAPES[model.category]
    attached = {limb.name: {limb.name} for limb in shape.limbs}
    for limb in shape.limbs:
        joints = limb.joints if isinstance(limb, Plate) and limb.joints else [limb.joint] if limb.joint else []
        for other, _ in joints:
            attached[limb.name].add(other)
            attached[other].add(limb.name)
    # Limbs on one joint may meet beside it, such as the thighs.
    joined = {a: set().union(*(attached[b] for b in near)) for a, near in attached.items()}
    limbs_of = {part: {limb.name for limb in shape.limbs if part in limb.part_names()} for part in shape.parts}
    pairs = np.unique(labels[mesh.face_adjacency], axis=0)
    for a, b in pairs[pairs[:, 0] != pairs[:, 1]]:
        one, other = (limbs_of[shape.parts[part]] for part in (a, b))
        assert any(joined[limb] & other for limb in one), (shape.parts[a], shape.parts[b])


def test_the_shares_of_the_parts_converge_with_the_resolution():
    shares = []
    for resolution in (LOW, 6000):
        [hand] = Synthetic(models=["hand"], resolution=resolution).models()
        mesh = hand.load()
        areas = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).area_faces
        shares.append(np.bincount(hand.human_segmentations()[0], weights=areas) / areas.sum())
    assert np.abs(shares[0] - shares[1]).max() < 0.01


def test_at_the_default_resolution_a_mesh_has_six_thousand_vertices_and_no_slivers():
    [hand] = Synthetic(models=["hand"]).models()
    mesh = hand.load()
    shape = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert len(mesh.vertices) == pytest.approx(6000, rel=0.06)
    assert np.degrees(shape.face_angles.min()) > 28
    assert np.degrees(np.quantile(shape.face_angles, 0.01)) > 40


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_shapes_of_other_proportions_are_as_sound_in_every_pose(seed):
    for model in Synthetic(resolution=LOW, seed=seed).models():
        model.load()


def ball(name, x, joint=None):
    points = [(x, 0, 0), (x + 0.01, 0, 0)]
    return Tube(name=name, points=points, radii=[0.3, 0.3], parts=name, subdivisions=1, joint=joint)


def test_a_surface_of_two_components_is_an_error():
    apart = Shape(name="apart", limbs=[ball("a", 0), ball("b", 1, joint=("a", 0))])
    with pytest.raises(DatasetError, match=r"shape apart, pose 1, dataset\.resolution=1000: .* 2 components instead"):
        make_mesh(apart, 1, 1000)


def test_a_part_without_a_face_is_an_error():
    hidden = Shape(name="egg", limbs=[ball("shell", 0), replace(ball("yolk", 0), radii=[0.1, 0.1])])
    mesh = make_mesh(hidden, 1, 1000)
    with pytest.raises(DatasetError, match="shape egg, pose 1: no face belongs to yolk; raise"):
        labelled(hidden, 1, *mesh)


def test_limbs_that_touch_in_a_pose_are_an_error():
    arms = [Tube(name=side, points=[(0, 0, 0), (x, 0, 0), (x, 0.8, 0)], radii=[0.1] * 3, parts=side, subdivisions=1)
            for side, x in (("left", 0.4), ("right", -0.4))]  # fmt: skip
    shape = Shape(name="tongs", limbs=arms, poses=[{"left": {1: (0, 0, 27)}, "right": {1: (0, 0, -27)}}])
    assert set(labelled(shape, 1, *make_mesh(shape, 1, 1000)).labels) == {0, 1}
    with pytest.raises(DatasetError, match=r"shape tongs, pose 2, .* has 1 handles instead of 0; raise"):
        make_mesh(shape, 2, 1000)


def test_a_pose_that_turns_no_limb_of_the_shape_is_an_error():
    with pytest.raises(ValueError, match="shape odd: a pose turns tail, which is not a limb"):
        Shape(name="odd", limbs=[ball("a", 0)], poses=[{"tail": {0: (0, 0, 1)}}]).solids(2)


def test_the_rest_pose_is_turned_nowhere_and_poses_keep_the_lengths_of_limbs():
    for shape in SHAPES.values():
        for rest, posed in zip(shape.solids(1), shape.solids(2), strict=True):
            assert np.allclose(rest.rotations, np.eye(3), atol=1e-12)
            assert np.array_equal(rest.parts, posed.parts)
            turned = np.einsum("pij,pkj->pik", posed.rotations, posed.rotations)
            assert np.allclose(turned, np.eye(3), atol=1e-9)
    straight = SHAPES["pliers"].limbs[1]
    lengths = [
        np.linalg.norm(np.diff(frames[straight.name].points, axis=0), axis=1)
        for frames in (SHAPES["pliers"].frames(turns) for turns in ({}, SHAPES["pliers"].poses[0]))
    ]
    assert np.allclose(*lengths)


def test_left_and_right_vary_alike_and_no_seed_varies_nothing():
    biped = SHAPES["biped"]
    assert biped.varied(None) is biped
    varied = {limb.name: limb for limb in biped.varied(3).limbs}
    for name, limb in varied.items():
        if name.startswith("left"):
            other = varied[name.replace("left", "right")]
            assert np.allclose(np.array(limb.points) * [-1, 1, 1], other.points)
            assert limb.radii == other.radii
    arm, drawn = varied["left arm"], next(limb for limb in biped.limbs if limb.name == "left arm")
    assert 0 < np.abs(np.log(np.array(arm.radii) / drawn.radii)).max() < 0.08
    assert repr(biped.varied(3)) == repr(biped.varied(3)) != repr(biped.varied(4))


def test_what_is_far_from_a_joint_of_pliers_turns_rigidly_about_it():
    [rest, wide] = Synthetic(models=["pliers", "pliers-2"], resolution=LOW).models()
    before, after = rest.load().vertices, wide.load().vertices
    far = np.flatnonzero((before[:, 2] < -0.5) & (before[:, 0] > 0))  # of the left handle, which turns by -17 degrees
    angle = np.radians(-17)
    x, y, z = before[far].T
    turned = np.column_stack([np.cos(angle) * x + np.sin(angle) * z, y, np.cos(angle) * z - np.sin(angle) * x])
    nearest = KDTree(after).query(turned)[1]
    assert len(far) > 100
    assert (wide.correspondence()[far] == nearest).mean() > 0.99


@pytest.mark.parametrize("name", ["hand-2", pytest.param("snake-2", marks=pytest.mark.slow)])
def test_corresponding_points_are_of_the_same_part_and_neighbours_stay_near_each_other(name):
    [posed] = Synthetic(models=[name], resolution=LOW).models()
    [rest] = Synthetic(models=[posed.category], resolution=LOW).models()
    assert np.array_equal(rest.correspondence(), np.arange(len(rest.load().vertices)))
    counterpart, (a, b) = posed.correspondence(), (model.load() for model in (rest, posed))
    labels = [field_of(SHAPES[rest.category], i).labels(mesh.vertices) for i, mesh in ((1, a), (2, b))]
    assert (labels[0] == labels[1][counterpart]).mean() > 0.94
    ends = counterpart[trimesh.Trimesh(a.vertices, a.faces, process=False).edges_unique]
    lengths = trimesh.Trimesh(b.vertices, b.faces, process=False).edges_unique_length
    apart = np.linalg.norm(b.vertices[ends[:, 0]] - b.vertices[ends[:, 1]], axis=1) / lengths.mean()
    assert np.median(apart) < 1.2
    assert apart.max() < 4
