import tracemalloc

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
import trimesh
from scipy.sparse.linalg import eigsh
from scipy.spatial.transform import Rotation

import heatwalk
from heatwalk.accumulators import heat_walk
from heatwalk.dissipators import relative_entropy_excess
from heatwalk.kernel import HeatKernel, largest_eigenvalue
from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from heatwalk.segmentation import faces_from_vertices
from heatwalk.spectrum import Spectrum
from tests.helpers.meshes import bundled

REAL = ["ant", "cow", "bunny", "airplane"]


def partition(labels):
    """The labels with each segment renamed to its smallest vertex: the same for the same partition."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return first[inverse]


def segmented(mesh, **options):
    return heatwalk.segment(mesh.vertices, mesh.faces, **options)


@pytest.mark.parametrize("name", REAL)
def test_the_result_is_as_documented(name):
    mesh = bundled(name)
    seg = segmented(mesh)
    k = len(seg.exemplars)
    assert seg.labels.shape == seg.accumulator_labels.shape == (len(mesh.vertices),)
    assert seg.face_labels.shape == (len(mesh.faces),)
    assert set(seg.accumulator_labels) == set(range(k))
    assert set(seg.labels) <= set(range(k + 1))
    assert (np.diff(seg.exemplars) > 0).all()
    assert seg.accumulator_labels[seg.exemplars].tolist() == list(range(k))
    kept = seg.labels < k
    assert np.array_equal(seg.labels[kept], seg.accumulator_labels[kept])
    assert np.array_equal(~kept, seg.dissipates)
    assert seg.n_components == mesh.body_count


# The ant and the airplane are mirror images of themselves: there the vertex order decides between equal peaks.
@pytest.mark.parametrize("name", ["cow", "bunny"])
def test_the_order_of_vertices_and_faces_does_not_matter(name):
    mesh = bundled(name)
    rng = np.random.default_rng(5)
    order, turn = rng.permutation(len(mesh.vertices)), rng.permutation(len(mesh.faces))
    place = np.argsort(order)
    shuffled = heatwalk.segment(mesh.vertices[order], np.roll(place[mesh.faces[turn]], 1, axis=1))
    seg = segmented(mesh)
    assert np.array_equal(np.sort(order[shuffled.exemplars]), seg.exemplars)
    assert np.array_equal(partition(shuffled.labels[place]), partition(seg.labels))
    assert np.array_equal(shuffled.dissipates[place], seg.dissipates)


@pytest.mark.parametrize("share", [0.02, 0.5, 1.0])
@pytest.mark.parametrize("name", REAL)
def test_faces_that_repeat_others_do_not_matter(name, share):
    mesh = bundled(name)
    rng = np.random.default_rng(5)
    repeated = rng.choice(mesh.faces, round(share * len(mesh.faces)), replace=False)
    turned = np.vstack((repeated[:, ::-1], np.roll(repeated, 1, axis=1)))  # the other winding, and another first corner
    seg = heatwalk.segment(mesh.vertices, np.vstack((mesh.faces, turned)))
    assert np.array_equal(seg.labels, segmented(mesh).labels)
    assert len(seg.face_labels) == len(mesh.faces) + len(turned)


@pytest.mark.parametrize("name", REAL)
def test_rigid_motions_do_not_matter(name):
    mesh = bundled(name)
    rotation = Rotation.random(rng=np.random.default_rng(1)).as_matrix()
    moved = heatwalk.segment(mesh.vertices @ rotation.T + mesh.extents * [3, -2, 1], mesh.faces)
    assert np.array_equal(moved.labels, segmented(mesh).labels)


@pytest.mark.parametrize("factor", [1e-30, 0.5, 1.5, 3, 10, 1e30])
@pytest.mark.parametrize("name", REAL)
def test_scale_does_not_matter(name, factor):
    mesh = bundled(name)
    seg = heatwalk.segment(factor * mesh.vertices, mesh.faces)
    assert np.array_equal(seg.labels, segmented(mesh).labels)


def test_the_input_is_left_as_it_is():
    mesh = bundled("ant")
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    before = vertices.copy(), faces.copy()
    heatwalk.segment(vertices, faces)
    assert np.array_equal(vertices, before[0])
    assert np.array_equal(faces, before[1])


@pytest.mark.parametrize("convert", [np.ndarray.tolist, lambda a: a.astype(a.dtype.kind + "4"), np.asfortranarray])
def test_lists_and_other_number_types_are_accepted(convert):
    mesh = bundled("ant")
    vertices = np.asarray(mesh.vertices).astype(np.float32).astype(np.float64)
    seg = heatwalk.segment(convert(vertices), convert(np.asarray(mesh.faces)))
    assert np.array_equal(seg.labels, heatwalk.segment(vertices, mesh.faces).labels)


def test_equal_times_in_different_units_give_equal_labels():
    mesh = bundled("cow")
    paper = segmented(mesh, time=1.2)
    assert paper.standard_time == pytest.approx(0.2)
    assert paper.fiedler_time == pytest.approx(0.2 * paper.spectrum.eigenvalues[0, 1])
    for unit, time in [("standard", paper.standard_time), ("fiedler", paper.fiedler_time)]:
        other = segmented(mesh, time=time, time_unit=unit)
        assert other.time == pytest.approx(1.2)
        assert np.array_equal(other.labels, paper.labels)


def test_longer_times_leave_fewer_exemplars():
    counts = [len(segmented(bundled("ant"), time=time).exemplars) for time in (0.1, 1, 10)]
    assert counts[0] > counts[1] > counts[2] >= 1


def test_split_dissipators_are_the_connected_pieces_of_the_dissipator_region():
    mesh = bundled("cow")
    whole, split = segmented(mesh, time=0.3), segmented(mesh, time=0.3, split_dissipators=True)
    k = len(whole.exemplars)
    assert np.array_equal(split.labels >= k, whole.labels == k)
    assert np.array_equal(split.labels[split.labels < k], whole.labels[whole.labels < k])
    inside = mesh.edges_unique[whole.dissipates[mesh.edges_unique].all(axis=1)]
    assert (split.labels[inside[:, 0]] == split.labels[inside[:, 1]]).all()
    pieces = trimesh.graph.connected_components(inside, nodes=np.flatnonzero(whole.dissipates))
    assert len(pieces) > 1
    assert split.labels.max() == k + len(pieces) - 1


def test_components_share_the_dissipator_region_but_no_accumulator_region():
    ant, cow = bundled("ant"), bundled("cow")
    seg = segmented(trimesh.util.concatenate([ant, cow]))
    n = len(ant.vertices)
    assert not set(seg.accumulator_labels[:n]) & set(seg.accumulator_labels[n:])


def test_faces_get_the_label_of_two_corners_or_else_that_of_the_first_corner():
    labels = np.array([0, 1, 2, 1])
    faces = np.array([[0, 1, 3], [1, 0, 3], [1, 3, 0], [0, 1, 2], [2, 1, 0], [0, 0, 1]])
    assert faces_from_vertices(labels, faces).tolist() == [1, 1, 1, 0, 2, 0]


# 12 and 40 need fewer eigenvalues than .13: their kernels use the front of a spectrum that reaches far beyond them.
@pytest.mark.parametrize(("name", "unit"), [("ant", "fiedler"), ("cow", "paper"), ("airplane", "paper")])
def test_many_times_from_one_spectrum_equal_those_from_separate_spectra(name, unit):
    mesh = bundled(name)
    times = [1.0, 0.13, 12, 0.4, 40, 3]
    together = list(heatwalk.segment_at_times(mesh.vertices, mesh.faces, times, time_unit=unit))
    assert len({id(seg.spectrum) for seg in together}) == 1
    for time, seg in zip(times, together, strict=True):
        alone = segmented(mesh, time=time, time_unit=unit)
        assert seg.time == pytest.approx(alone.time)
        assert np.array_equal(seg.labels, alone.labels)
        assert np.array_equal(seg.face_labels, alone.face_labels)
        assert np.array_equal(seg.exemplars, alone.exemplars)
        np.testing.assert_allclose(seg.relative_entropy_excess, alone.relative_entropy_excess, rtol=0, atol=1e-8)


def test_an_empty_list_of_times_is_rejected():
    with pytest.raises(ValueError, match="times is empty"):
        heatwalk.segment_at_times(bundled("ant").vertices, bundled("ant").faces, [])


@pytest.mark.parametrize("name", REAL)
def test_the_labels_from_scipys_eigsh_are_the_same(name):
    """Both eigensolvers lead to the same labels; SciPy's is given each component's own matrix, as it should be."""
    mesh = bundled(name)
    seg = segmented(mesh)
    spectrum = eigsh_spectrum(mesh, largest_eigenvalue(seg.standard_time))
    kernel = HeatKernel.from_spectrum(spectrum, seg.standard_time)
    walk = heat_walk(kernel)
    assert np.array_equal(walk.exemplars, seg.exemplars)
    assert np.array_equal(walk.labels, seg.accumulator_labels)
    assert np.array_equal(relative_entropy_excess(kernel, walk.labels) > 0, seg.dissipates)


def eigsh_spectrum(mesh, limit):
    stiffness, mass = stiffness_and_mass(unit_area(mesh.vertices, mesh.faces), mesh.faces)
    component = vertex_components(len(mass), mesh.faces)
    pairs = []
    for c in range(component.max() + 1):
        members = np.flatnonzero(component == c)
        own = stiffness[members][:, members], sp.diags_array(mass[members]).tocsc()
        if len(members) < 200:
            values, vectors = scipy.linalg.eigh(*(matrix.toarray() for matrix in own))
        else:
            values, vectors = eigsh(own[0], 50, own[1], sigma=-0.1, v0=np.ones(len(members)))
        order = np.argsort(values)
        assert values[order[-1]] > limit
        pairs.append((members, values[order], vectors[:, order]))
    width = max(len(values) for _, values, _ in pairs)
    eigenvalues, eigenvectors = np.full((len(pairs), width), np.inf), np.zeros((len(mass), width))
    for c, (members, values, vectors) in enumerate(pairs):
        eigenvalues[c, : len(values)] = values
        eigenvectors[members, : len(values)] = vectors
    return Spectrum(eigenvalues, eigenvectors, component, mass, limit, 0.0)


@pytest.mark.parametrize("time", [0, -1, np.nan, np.inf])
def test_a_time_that_is_not_positive_is_rejected(time):
    with pytest.raises(ValueError, match="time must be positive and finite"):
        segmented(bundled("ant"), time=time)


@pytest.mark.parametrize(
    ("option", "valid"), [("time_unit", "paper, standard, fiedler"), ("density", "vertices, area")]
)
def test_an_unknown_option_is_rejected_with_the_valid_ones(option, valid):
    with pytest.raises(ValueError, match=f"{option} must be one of {valid}, got 'furlong'"):
        segmented(bundled("ant"), **{option: "furlong"})


def test_memory_stays_in_proportion_to_the_vertices(monkeypatch):
    monkeypatch.setattr("heatwalk.kernel.BLOCK_BYTES", 2**20)
    mesh = trimesh.creation.icosphere(4)  # 2562 vertices: the n x n kernel would take 52 MB
    segmented(mesh)
    tracemalloc.start()
    segmented(mesh).divergence_from_region  # noqa: B018
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 15e6
