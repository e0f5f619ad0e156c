import dataclasses

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import heatwalk
import perturb
from heatwalk.confidence import dissipator_margin, walk_margin
from heatwalk.numerics.compilation import seconds_compiled
from heatwalk.robust.averaging import times_around
from heatwalk.robust.options import Options
from heatwalk.robust.repair import Repair
from heatwalk.robust.segmentation import compile_ahead, segment_robust_at_times
from perturb.testing import odd_meshes
from tests.helpers.blobs import beads
from tests.helpers.meshes import bundled

NO_REPAIR = Repair(stitch=False, cut_handles=False, fill_holes=False, remove_spikes=False, fair=False)
OFF = Options(NO_REPAIR, average=False, choose_time=False, merge=False, join_small=False)


@pytest.fixture(scope="module")
def cow():
    mesh = bundled("cow")
    return np.array(mesh.vertices), np.array(mesh.faces)


@pytest.fixture(scope="module")
def seg(cow):
    return heatwalk.segment_robust(*cow)


def partition(labels):
    """The labels with each segment renamed to its smallest vertex: the same for the same partition."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return first[inverse]


@pytest.mark.parametrize("name", ["cow", "ant", "airplane"])
@pytest.mark.parametrize(
    "options", [{"density": "vertices"}, {"time": 3.0, "density": "vertices", "split_dissipators": True}]
)
def test_without_any_part_it_is_the_walk_as_published(name, options):
    mesh = bundled(name)
    ours = heatwalk.segment_robust(mesh.vertices, mesh.faces, **options, options=OFF)
    theirs = heatwalk.segment(mesh.vertices, mesh.faces, **options)
    for field in ("labels", "accumulator_labels", "face_labels", "exemplars", "relative_entropy_excess", "margin"):
        assert np.array_equal(getattr(ours, field), getattr(theirs, field)), field
    assert (ours.time, ours.standard_time, ours.n_segments) == (theirs.time, theirs.standard_time, theirs.n_segments)


def test_the_result_is_as_documented(cow, seg):
    n, k = len(cow[0]), len(seg.exemplars)
    assert seg.labels.shape == seg.accumulator_labels.shape == seg.margin.shape == (n,)
    assert set(seg.accumulator_labels) == set(range(k))
    assert (np.diff(seg.exemplars) > 0).all()
    assert seg.accumulator_labels[seg.exemplars].tolist() == list(range(k))
    assert np.array_equal(seg.labels == k, seg.dissipates)
    assert np.allclose(seg.times, times_around(seg.standard_time, octaves=2))
    assert np.isclose(seg.standard_time, seg.time / 6)
    joined = seg.merging.of_region[seg.walk.labels][:n]
    assert np.array_equal(partition(joined), partition(seg.accumulator_labels))
    assert list(seg.seconds) == [
        "compilation", "operator", "repair", "spectrum", "time", "walk", "merging", "dissipators"
    ]  # fmt: skip


def test_every_region_has_its_share_of_the_area_and_persists(seg):
    areas = np.bincount(seg.merging.of_region[seg.walk.labels], seg.spectrum.mass)
    assert (areas >= seg.options.min_area * areas.sum()).all()
    assert len(seg.exemplars) < len(seg.walk.exemplars)


@pytest.mark.parametrize("scale", [1, 1e-150, 1e150])
def test_rigid_motions_and_scale_do_not_matter(cow, seg, scale):
    vertices, faces = cow
    rotation = Rotation.random(rng=np.random.default_rng(1)).as_matrix()
    moved = heatwalk.segment_robust(scale * (vertices @ rotation.T + np.ptp(vertices, axis=0) * [3, -2, 1]), faces)
    assert np.array_equal(moved.exemplars, seg.exemplars)
    assert np.mean(moved.labels != seg.labels) < 0.001


def test_noise_and_holes_move_it_less_than_the_walk_as_published(cow, seg):
    from perturb import Holes, NormalNoise
    from studies.metrics import change_percentage

    mesh, changes = trimesh.Trimesh(*cow, process=False), []
    for perturbation in (NormalNoise(amount=0.5), Holes(amount=150)):
        variant = perturbation(mesh, np.random.default_rng(0))
        kept = variant.counterpart >= 0
        for function, before in ((heatwalk.segment_robust, seg), (heatwalk.segment, heatwalk.segment(*cow))):
            after = function(variant.mesh.vertices, variant.mesh.faces).labels
            changes.append(change_percentage(before.labels[kept], after[variant.counterpart[kept]]))
    robust, published = np.array(changes).reshape(2, 2).T
    assert (robust < published).all()
    assert robust.mean() < published.mean() / 2


def test_two_beads_on_a_string_are_two_regions_at_any_time():
    vertices, faces = beads([1.0, 0.8])
    for result in segment_robust_at_times(vertices, faces, [0.6, 1, 2.7]):
        assert len(result.exemplars) == 2
        side = vertices[:, 0] > 2.0
        assert np.mean(result.accumulator_labels == result.accumulator_labels[0]) == pytest.approx(
            np.mean(~side), abs=0.05
        )


@pytest.mark.parametrize("amount", [0.3, 1.0])
def test_faces_cut_loose_have_the_labels_of_the_surface_that_they_make(cow, seg, amount):
    vertices = cow[0]
    loose = perturb.Unwelded(amount)(trimesh.Trimesh(*cow, process=False), np.random.default_rng(0)).mesh
    assert len(loose.vertices) > len(vertices)
    mended = heatwalk.segment_robust(loose.vertices, loose.faces)
    assert np.array_equal(partition(mended.face_labels), partition(seg.face_labels))
    assert np.array_equal(mended.labels[: len(vertices)], seg.labels)
    at_position = {tuple(p): label for p, label in zip(vertices, seg.labels, strict=True)}
    assert mended.labels.tolist() == [at_position[tuple(p)] for p in np.asarray(loose.vertices)]
    assert np.array_equal(mended.exemplars, seg.exemplars)
    assert np.array_equal(mended.margin[: len(vertices)], seg.margin)
    assert np.array_equal(mended.divergence_from_uniform[: len(vertices)], seg.divergence_from_uniform)


def test_several_times_give_what_each_gives_alone(cow, seg):
    some = list(segment_robust_at_times(*cow, [2.5, 1.0]))
    assert np.array_equal(some[1].labels, seg.labels)
    assert some[1].time == seg.time
    assert (some[0].requested_time, some[1].requested_time) == pytest.approx((2.5, 1.0))
    assert np.array_equal(heatwalk.segment_robust(*cow, 2.5).labels, some[0].labels)


def test_the_margin_is_the_smallest_of_walk_joining_and_test(seg):
    n, joined = len(seg.labels), seg.merging.of_region[seg.walk.labels]
    of_walk, of_test = walk_margin(seg.kernel, seg.walk, joined)[:n], dissipator_margin(seg.relative_entropy_excess)
    smallest = np.minimum(np.minimum(of_walk, seg.merging.margin[seg.walk.labels][:n]), of_test)
    assert np.array_equal(seg.margin, np.where(seg.dissipates, of_test, smallest))
    assert ((seg.margin >= 0) & (seg.margin <= 1)).all()


def test_specks_take_the_label_of_the_nearest_vertex():
    vertices, faces = beads([1.0, 0.8])
    tetrahedron = np.array([[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0], [0, 0, 0.05]])
    specks = np.vstack([tetrahedron + np.array([1, 0, 1.05]), tetrahedron + np.array([2.8, 0, 0.9])])
    sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    n = len(vertices)
    alone = heatwalk.segment_robust(vertices, faces)
    result = heatwalk.segment_robust(np.vstack([vertices, specks]), np.vstack([faces, sides + n, sides + n + 4]))
    assert (result.n_components, len(result.exemplars)) == (3, 2)
    assert np.array_equal(result.labels[:n], alone.labels)
    assert (
        result.accumulator_labels[n:].tolist() == [alone.accumulator_labels[0]] * 4 + [alone.accumulator_labels[-1]] * 4
    )
    nearest = np.linalg.norm(vertices - specks[:, None], axis=2).argmin(axis=1)
    assert np.array_equal(result.labels[n:], result.labels[nearest])
    assert np.array_equal(result.margin[n:], result.margin[nearest])


def test_each_component_has_regions_of_its_own(cow):
    vertices, faces = cow
    beside = vertices + np.array([0, 0, 2 * np.ptp(vertices[:, 2])])
    twice = np.vstack([vertices, beside]), np.vstack([faces, faces + len(vertices)])
    two = heatwalk.segment_robust(*twice)
    one, other = two.accumulator_labels[: len(vertices)], two.accumulator_labels[len(vertices) :]
    assert not set(one) & set(other)
    assert np.array_equal(partition(one), partition(other))


@pytest.mark.parametrize("name", sorted(odd_meshes().keys() - {"soup"}))
def test_odd_meshes_have_labels_or_a_reason_why_not(name):
    mesh = odd_meshes()[name]
    if (problem := heatwalk.inspect_mesh(mesh.vertices, mesh.faces).problem) is not None:
        with pytest.raises(heatwalk.MeshError) as error:
            heatwalk.segment_robust(mesh.vertices, mesh.faces)
        assert str(error.value) == problem
        return
    result = heatwalk.segment_robust(mesh.vertices, mesh.faces)
    assert result.labels.shape == (len(mesh.vertices),)
    assert result.labels.min() >= 0
    assert np.isfinite(result.margin).all()


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("merge", 1, "merge is 1: it must be true or false"),
        ("persistence", 0.0, "persistence is 0.0: it must be above 0 and at most 1"),
        ("min_area", 1.0, "min_area is 1.0: it must be at least 0 and below 1"),
        ("octaves_after", 9.0, "octaves_after is 9.0: it must be from 0 to 8"),
    ],
)
def test_an_invalid_option_is_refused(option, value, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        dataclasses.replace(Options(), **{option: value})


def test_compiling_ahead_leaves_nothing_to_compile():
    compile_ahead()
    seconds = seconds_compiled()
    torus = trimesh.creation.torus(1, 0.4, major_sections=24, minor_sections=24)
    vertices = np.array(torus.vertices)
    vertices[50] *= 1.4
    result = heatwalk.segment_robust(vertices, torus.faces[7:])
    assert result.repaired.report["holes_filled"] > 0
    assert seconds_compiled() == seconds
    assert result.seconds["compilation"] == 0
