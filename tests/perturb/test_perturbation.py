"""What every perturbation promises, whatever it does."""

import dataclasses
import hashlib
import json
import pickle
from pathlib import Path

import hydra
import numpy as np
import pytest
import trimesh
from omegaconf import OmegaConf
from scipy.cluster.hierarchy import DisjointSet

import perturb
from perturb import PerturbationError
from perturb.perturbation import LENGTHS
from tests.helpers.meshes import bundled

EXAMPLES = [
    perturb.NormalNoise(0.34),
    perturb.NormalNoise(0.02, "bounding_box_diagonal", "uniform"),
    perturb.ShotNoise(0.06),
    perturb.ShotNoise(0.3, height=0.23, height_unit="bounding_box_diagonal"),
    perturb.Holes(58),
    perturb.Holes(0.15, "share_of_triangles"),
    perturb.Holes(40, "one_rings"),
    perturb.ShortCircuits(5),
    perturb.ShortCircuits(5, bridge="strip"),
    perturb.Decimation(0.4),
    perturb.Decimation(0.4, backend="pymeshlab"),
    perturb.Scaling(3.0),
    perturb.MissingParts(0.1),
    perturb.MissingParts(0.1, shape="plane"),
    perturb.Tessellation(2.0),
    perturb.Tessellation(4.0, method="subdivision"),
    perturb.Tessellation(2.0, method="anisotropic"),
    perturb.Tessellation(2.0, method="irregular"),
]
CERTAIN = (perturb.Decimation, perturb.Scaling)
RANDOM = [
    example
    for example in EXAMPLES
    if not (isinstance(example, CERTAIN) or getattr(example, "method", "") in ("isotropic", "subdivision"))
]
every_example = pytest.mark.parametrize("perturbation", EXAMPLES, ids=repr)
CONFIGS = sorted((Path(__file__).parents[2] / "conf" / "perturbation").glob("*.yaml"))


@pytest.fixture(scope="module", params=["ant", "cow"])
def mesh(request):
    return bundled(request.param)


def rng(seed=0):
    return np.random.default_rng(seed)


def digest(mesh):
    arrays = np.asarray(mesh.vertices).tobytes() + np.asarray(mesh.faces).tobytes()
    return hashlib.sha256(arrays).hexdigest()


def test_examples_cover_every_registered_name():
    assert perturb.names() == sorted({example.name for example in EXAMPLES})
    assert perturb.names() == [
        "decimation",
        "holes",
        "missing_parts",
        "normal_noise",
        "scaling",
        "short_circuits",
        "shot_noise",
        "tessellation",
    ]


@pytest.mark.parametrize("name", perturb.names())
def test_get_gives_the_class_of_that_name(name):
    assert perturb.get(name).name == name
    assert perturb.get(name) is getattr(perturb, "".join(word.title() for word in name.split("_")))


def test_an_unknown_name_is_answered_with_the_names_there_are():
    with pytest.raises(PerturbationError, match=r"'hole'.*decimation, holes, missing_parts"):
        perturb.get("hole")


@every_example
def test_the_input_is_not_touched_nor_shared(perturbation, mesh):
    before = digest(mesh)
    result = perturbation(mesh, rng())
    assert digest(mesh) == before
    assert not np.shares_memory(result.mesh.vertices, mesh.vertices)
    assert not np.shares_memory(result.mesh.faces, mesh.faces)


@every_example
def test_the_same_seed_gives_the_same_result(perturbation, mesh):
    first, second = perturbation(mesh, rng(7)), perturbation(mesh, rng(7))
    assert digest(first.mesh) == digest(second.mesh)
    np.testing.assert_array_equal(first.counterpart, second.counterpart)
    assert first.applied == second.applied


@pytest.mark.parametrize("perturbation", RANDOM, ids=repr)
def test_another_seed_gives_another_result(perturbation, mesh):
    assert digest(perturbation(mesh, rng(7)).mesh) != digest(perturbation(mesh, rng(8)).mesh)


@every_example
def test_sampled_parameters_can_be_applied_again(perturbation, mesh):
    parameters = perturbation.sample(mesh, rng(3))
    called = perturbation(mesh, rng(3))
    for _ in range(2):
        applied = perturbation.apply(mesh, parameters)
        assert digest(applied.mesh) == digest(called.mesh)
        np.testing.assert_array_equal(applied.counterpart, called.counterpart)
        assert applied.applied == called.applied


@every_example
def test_the_neutral_amount_is_the_identity(perturbation, mesh):
    result = dataclasses.replace(perturbation, amount=perturbation.neutral)(mesh, rng())
    np.testing.assert_array_equal(result.mesh.vertices, mesh.vertices)
    np.testing.assert_array_equal(result.mesh.faces, mesh.faces)
    np.testing.assert_array_equal(result.counterpart, np.arange(len(mesh.vertices)))
    assert not np.shares_memory(result.mesh.vertices, mesh.vertices)


@every_example
def test_the_neutral_amount_keeps_even_vertices_without_faces(perturbation):
    cow = bundled("cow")
    vertices = np.concatenate([[[9.0, 9.0, 9.0]], cow.vertices])
    stray = trimesh.Trimesh(vertices, cow.faces + 1, process=False)
    result = dataclasses.replace(perturbation, amount=perturbation.neutral)(stray, rng())
    np.testing.assert_array_equal(result.mesh.vertices, vertices)
    np.testing.assert_array_equal(result.counterpart, np.arange(len(vertices)))


def test_amount_0_is_the_neutral_one_except_where_it_would_leave_nothing():
    neutral = {name: perturb.get(name).neutral for name in perturb.names()}
    assert neutral == dict.fromkeys(perturb.names(), 0.0) | {"decimation": 1.0, "scaling": 1.0}
    for name in ("decimation", "scaling"):
        with pytest.raises(PerturbationError, match="must be above 0"):
            perturb.get(name)(amount=0)


@every_example
def test_counterparts_are_vertices_of_the_result_or_gone(perturbation, mesh):
    result = perturbation(mesh, rng())
    assert result.counterpart.shape == (len(mesh.vertices),)
    assert result.counterpart.dtype == np.int64
    there = result.counterpart[result.counterpart >= 0]
    assert result.counterpart.min() >= -1
    # Every vertex of the result comes from somewhere; where nearness decides that need not be so.
    if result.applied.get("counterpart_by") not in ("nearest_vertex", "closest_point"):
        np.testing.assert_array_equal(np.unique(there), np.arange(len(result.mesh.vertices)))
    assert there.max() < len(result.mesh.vertices)
    np.testing.assert_array_equal(np.unique(result.mesh.faces), np.arange(len(result.mesh.vertices)))


@every_example
def test_applied_survives_json_and_holds_plain_scalars_only(perturbation, mesh):
    applied = dataclasses.replace(perturbation, amount=np.float64(perturbation.amount))(mesh, rng()).applied
    assert json.loads(json.dumps(applied, allow_nan=False)) == applied
    assert {type(value) for value in applied.values()} <= {str, int, float, bool, type(None)}
    assert applied["name"] == perturbation.name
    assert {f.name: applied[f.name] for f in dataclasses.fields(perturbation)} == dataclasses.asdict(perturbation)


@every_example
def test_applied_counts_vertices_faces_and_components(perturbation, mesh):
    result = perturbation(mesh, rng())
    for when, counted in (("before", mesh), ("after", result.mesh)):
        components = DisjointSet(np.unique(counted.faces).tolist())
        for a, b, c in counted.faces.tolist():
            components.merge(a, b)
            components.merge(b, c)
        assert result.applied[f"vertices_{when}"] == len(counted.vertices)
        assert result.applied[f"faces_{when}"] == len(counted.faces)
        assert result.applied[f"components_{when}"] == components.n_subsets


@every_example
def test_perturbations_and_their_results_survive_pickling(perturbation, mesh):
    assert pickle.loads(pickle.dumps(perturbation)) == perturbation
    result = perturbation(mesh, rng())
    again = pickle.loads(pickle.dumps(result))
    assert digest(again.mesh) == digest(result.mesh)
    np.testing.assert_array_equal(again.counterpart, result.counterpart)
    assert again.applied == result.applied


@pytest.mark.parametrize("factor", [2.0**-100, 2.0**100])  # powers of two: scaling rounds nothing
@every_example
def test_amounts_are_relative_so_a_scaled_mesh_is_perturbed_alike(perturbation, mesh, factor):
    scaled = trimesh.Trimesh(mesh.vertices * factor, mesh.faces, process=False)
    result, expected = perturbation(scaled, rng()), perturbation(mesh, rng())
    np.testing.assert_array_equal(result.mesh.faces, expected.mesh.faces)
    np.testing.assert_array_equal(result.counterpart, expected.counterpart)
    difference = np.abs(result.mesh.vertices / factor - expected.mesh.vertices).max()
    assert difference <= 1e-12 * mesh.scale


def test_units_of_length_are_those_of_the_mesh():
    mesh = bundled("cow")
    corners = np.asarray(mesh.vertices)[np.unique(mesh.edges_sorted, axis=0)]
    edges = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)
    box = mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)
    assert LENGTHS["mean_edge_length"](mesh) == pytest.approx(edges.mean(), rel=1e-12)
    assert LENGTHS["bounding_box_diagonal"](mesh) == pytest.approx(np.sqrt((box**2).sum()), rel=1e-12)


@pytest.mark.parametrize("name", perturb.names())
@pytest.mark.parametrize("amount", [-0.1, float("nan"), float("inf"), "much", None])
def test_an_amount_that_is_no_size_is_refused(name, amount):
    with pytest.raises(PerturbationError, match=rf"{name}: amount is .*must be a number of at least 0"):
        perturb.get(name)(amount=amount)


@pytest.mark.parametrize("name", perturb.names())
def test_an_unknown_unit_is_answered_with_the_units_there_are(name):
    with pytest.raises(PerturbationError, match=f"{name}: unit is 'furlong'; choose one of") as error:
        perturb.get(name)(unit="furlong")
    assert str(error.value).endswith(", ".join(perturb.get(name).choices["unit"]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: perturb.NormalNoise(distribution="cauchy"), "choose one of gaussian, uniform"),
        (lambda: perturb.ShotNoise(1.1), "at most 1"),
        (lambda: perturb.ShotNoise(height=-1), "height is -1"),
        (lambda: perturb.ShotNoise(height_unit="vertices"), "mean_edge_length, bounding_box_diagonal"),
        (lambda: perturb.Holes(1.5), "must be a whole number"),
        (lambda: perturb.Holes(1.5, "share_of_triangles"), "at most 1"),
        (lambda: perturb.Holes(0.5, "one_rings"), "must be a whole number"),
        (lambda: perturb.ShortCircuits(2.5), "must be a whole number"),
        (lambda: perturb.ShortCircuits(near=0), "near is 0; it must be above 0"),
        (lambda: perturb.ShortCircuits(near=0.2, far=0.2), "far must be at least 1.5 times near"),
        (lambda: perturb.ShortCircuits(bridge="rope"), "choose one of tube, strip"),
        (lambda: perturb.Tessellation(method="random"), "choose one of isotropic, subdivision, anisotropic, irregular"),
        (lambda: perturb.Tessellation(2, method="subdivision"), "amount is 2, and subdivision makes 4, 16, 64"),
        (lambda: perturb.Tessellation(stretch=0.5), "stretch is 0.5; it must be above 1"),
        (lambda: perturb.Tessellation(grading=float("inf")), "grading is inf"),
        (lambda: perturb.Decimation(1.01), "at most 1"),
        (lambda: perturb.Decimation(backend="vtk"), "choose one of fast_simplification, pymeshlab"),
        (lambda: perturb.MissingParts(1), "must be below 1"),
        (lambda: perturb.MissingParts(shape="cube"), "choose one of geodesic_ball, plane"),
    ],
)
def test_options_out_of_range_are_refused_when_built(make, message):
    with pytest.raises(PerturbationError, match=message):
        make()


@every_example
@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.eye(4, 3), np.zeros((0, 3), dtype=int), "has no face"),
        (np.eye(3), [[0, 1, 2]], "fewer than 4 vertices"),
        (np.arange(12.0).reshape(4, 3), [[0, 1, 2], [1, 2, 3]], "only degenerate triangles"),
        (np.ones((4, 3)), [[0, 1, 2], [1, 2, 3]], "only degenerate triangles"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, np.nan]], [[0, 1, 2], [0, 2, 3]], "not finite"),
    ],
)
def test_a_mesh_that_nothing_can_be_done_with_is_refused(perturbation, vertices, faces, message):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    with pytest.raises(PerturbationError, match=f"{perturbation.name}: the mesh handed in .*{message}"):
        perturbation(mesh, rng())


@pytest.mark.parametrize(
    ("perturbation", "message"),
    [
        (perturb.Holes(1, "share_of_triangles"), "the result has no face"),
        (perturb.Holes(911), "the result has fewer than 4 vertices"),
        (perturb.Holes(913), "913 triangles are asked for; the mesh has 912"),
        (perturb.Holes(487, "one_rings"), "487 one_rings are asked for; the mesh has 486"),
        (perturb.MissingParts(0.999), "the result has no face"),
        (perturb.Decimation(0.001), "the result"),
        (perturb.Scaling(1e308), "not finite"),
    ],
    ids=repr,
)
def test_a_result_of_which_nothing_is_left_is_refused(perturbation, message):
    with pytest.raises(PerturbationError, match=message):
        perturbation(bundled("ant"), rng())


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_the_shipped_config_names_every_field_with_its_default(path):
    config = OmegaConf.load(path)
    perturbation = hydra.utils.instantiate(config)
    assert perturbation == perturb.get(path.stem)()
    assert set(config) - {"_target_"} == {field.name for field in dataclasses.fields(perturbation)}
    level = hydra.utils.instantiate(config, amount=perturbation.neutral)
    assert level == dataclasses.replace(perturbation, amount=perturbation.neutral)


def test_every_perturbation_ships_a_config():
    assert [path.stem for path in CONFIGS] == perturb.names()
