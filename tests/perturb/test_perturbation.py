"""What is required of every perturbation, whatever it does."""

import dataclasses
import hashlib
from functools import cache
from importlib import import_module
from pathlib import Path

import hydra
import numpy as np
import pytest
import trimesh
from omegaconf import OmegaConf
from scipy.cluster.hierarchy import DisjointSet
from trimesh.caching import tracked_array

import perturb
from perturb import PerturbationError
from perturb.testing import check_perturbation
from tests.helpers.meshes import bundled, coarse
from tests.helpers.perturbing import rng

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
    perturb.ShortCircuits(3, near=0.3, ratio=1.2, bridge="triangle"),
    perturb.ShortCircuits(3, near=0.3, ratio=1.2, where="internal"),
    perturb.Decimation(0.4),
    perturb.Decimation(0.4, backend="pymeshlab"),
    perturb.Scaling(3.0),
    perturb.MissingParts(0.1),
    perturb.MissingParts(0.1, shape="plane"),
    perturb.Tessellation(1.0),
    perturb.Tessellation(4.0, method="subdivision"),
    perturb.Tessellation(1.0, method="anisotropic"),
    perturb.Tessellation(1.0, method="irregular"),
    perturb.SelfIntersections(2, thickness=0.5),
    perturb.Composite(0.8),
    perturb.Duplicates(0.2),
    perturb.Flipped(0.2),
    perturb.Floaters(0.02),
    perturb.MicroHoles(0.03),
    perturb.Quantisation(7),
    perturb.Rasterisation(0.06),
    perturb.Slivers(0.1),
    perturb.Unwelded(0.2),
    perturb.View(0.75),
    perturb.Welding(0.04, "bounding_box_diagonal", far=0.1),
]
DETERMINISTIC = (perturb.Decimation, perturb.Scaling, perturb.Quantisation, perturb.Welding)
RANDOM = [
    example
    for example in EXAMPLES
    if not (isinstance(example, DETERMINISTIC) or getattr(example, "method", "") in ("isotropic", "subdivision"))
]
SHIPPED = sorted({example.name for example in EXAMPLES})
# A perturbation that is added to the package is checked without being listed here.
ADDED = [perturb.get(name)() for name in perturb.names() if name not in SHIPPED]
# They take several seconds on the meshes of the suite. What is not slow runs the suite on one mesh, or on real ones.
LONGER = ("sampling", "tessellation")
every_example = pytest.mark.parametrize("perturbation", EXAMPLES, ids=repr)
CONFIGS = sorted((Path(__file__).parents[2] / "conf" / "perturbation").glob("*.yaml"))


@pytest.fixture(scope="module", params=["ant", "cow"])
def mesh(request):
    """A shape of angular components, and one of a single component with holes in it: a cow of a third of its faces."""
    mesh = bundled(request.param)
    return coarse(mesh, 2000) if request.param == "cow" else mesh


@cache
def perturbed(perturbation, mesh):
    """The result with the seed 0, which tests do not change."""
    return perturbation(mesh, rng())


def digest(mesh):
    arrays = np.asarray(mesh.vertices).tobytes() + np.asarray(mesh.faces).tobytes()
    return hashlib.sha256(arrays).hexdigest()


def test_every_shipped_perturbation_has_an_example():
    assert set(SHIPPED) <= set(perturb.names())
    assert SHIPPED == [
        "composite",
        "decimation",
        "duplicates",
        "flipped",
        "floaters",
        "holes",
        "micro_holes",
        "missing_parts",
        "normal_noise",
        "quantisation",
        "rasterisation",
        "scaling",
        "self_intersections",
        "short_circuits",
        "shot_noise",
        "slivers",
        "tessellation",
        "unwelded",
        "view",
        "welding",
    ]


@pytest.mark.parametrize("name", SHIPPED)
def test_get_returns_the_class_of_that_name(name):
    assert perturb.get(name).name == name
    assert perturb.get(name) is getattr(perturb, "".join(word.title() for word in name.split("_")))


def test_an_unknown_name_is_answered_with_the_registered_ones():
    with pytest.raises(PerturbationError, match=r"'hole'.*decimation, .*holes, .*missing_parts"):
        perturb.get("hole")


@pytest.mark.parametrize(
    "perturbation",
    [
        pytest.param(example, id=repr(example), marks=[pytest.mark.slow] if example.name in LONGER else [])
        for example in EXAMPLES + ADDED
    ],
)
def test_every_perturbation_conforms_on_the_meshes_of_the_suite(perturbation):
    check_perturbation(perturbation)


@every_example
def test_every_example_conforms_on_real_meshes(perturbation, mesh):
    check_perturbation(perturbation, [mesh])


@pytest.mark.parametrize("perturbation", RANDOM, ids=repr)
def test_another_seed_yields_another_result(perturbation, mesh):
    assert digest(perturbed(perturbation, mesh).mesh) != digest(perturbation(mesh, rng(8)).mesh)


@every_example
def test_the_neutral_amount_keeps_even_vertices_without_faces(perturbation):
    cow = bundled("cow")
    vertices = np.concatenate([[[9.0, 9.0, 9.0]], cow.vertices])
    with_unreferenced = trimesh.Trimesh(vertices, cow.faces + 1, process=False)
    result = dataclasses.replace(perturbation, amount=perturbation.neutral)(with_unreferenced, rng())
    np.testing.assert_array_equal(result.mesh.vertices, vertices)
    np.testing.assert_array_equal(result.counterpart, np.arange(len(vertices)))


def test_amount_0_is_neutral_unless_it_would_leave_nothing():
    neutral = {perturb.get(name).name: perturb.get(name).neutral for name in SHIPPED}
    assert neutral == dict.fromkeys(SHIPPED, 0.0) | {"decimation": 1.0, "scaling": 1.0, "quantisation": 53.0}
    for name in ("decimation", "scaling", "quantisation"):
        with pytest.raises(PerturbationError, match="must be above 0"):
            perturb.get(name)(amount=0)


@every_example
def test_counterparts_cover_the_result_unless_they_are_found_by_nearness(perturbation, mesh):
    result = perturbed(perturbation, mesh)
    used = np.arange(len(result.mesh.vertices))
    if result.applied.get("counterpart_by") not in ("nearest_vertex", "closest_point"):
        former = used[: len(used) - result.applied.get("vertices_added", 0)]  # what is added follows
        np.testing.assert_array_equal(np.unique(result.counterpart[result.counterpart >= 0]), former)
    np.testing.assert_array_equal(np.unique(result.mesh.faces), used)


@every_example
def test_numpy_scalars_as_fields_become_plain_numbers_in_applied(perturbation):
    with_numpy = dataclasses.replace(perturbation, amount=np.float64(perturbation.amount))
    applied = with_numpy(bundled("ant"), rng()).applied
    assert {type(value) for value in applied.values()} <= {str, int, float, bool, type(None)}
    assert applied["amount"] == perturbation.amount


@every_example
def test_applied_counts_vertices_faces_and_components(perturbation, mesh):
    result = perturbed(perturbation, mesh)
    for when, counted in (("before", mesh), ("after", result.mesh)):
        components = DisjointSet(np.unique(counted.faces).tolist())
        for a, b, c in counted.faces.tolist():
            components.merge(a, b)
            components.merge(b, c)
        assert result.applied[f"vertices_{when}"] == len(counted.vertices)
        assert result.applied[f"faces_{when}"] == len(counted.faces)
        assert result.applied[f"components_{when}"] == components.n_subsets


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("amount", [-0.1, float("nan"), float("inf"), "much", None])
def test_an_amount_that_is_not_a_finite_number_of_at_least_0_is_refused(name, amount):
    with pytest.raises(PerturbationError, match=rf"{name}: amount is .*must be a number of at least 0"):
        perturb.get(name)(amount=amount)


@pytest.mark.parametrize("name", SHIPPED)
def test_an_unknown_unit_is_answered_with_the_valid_ones(name):
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
        (lambda: perturb.Tessellation(2, method="subdivision"), "amount is 2, but subdivision makes 4, 16, 64"),
        (lambda: perturb.Tessellation(stretch=0.5), "stretch is 0.5; it must be above 1"),
        (lambda: perturb.Tessellation(grading=float("inf")), "grading is inf"),
        (lambda: perturb.Decimation(1.01), "at most 1"),
        (lambda: perturb.Decimation(backend="vtk"), "choose one of fast_simplification, pymeshlab"),
        (lambda: perturb.MissingParts(1), "must be below 1"),
        (lambda: perturb.MissingParts(shape="cube"), "choose one of geodesic_ball, plane"),
        (lambda: perturb.MicroHoles(1.1), "at most 1"),
        (lambda: perturb.MicroHoles(1.1, "share_of_triangles"), "at most 1"),
        (lambda: perturb.Floaters(1.1), "at most 1"),
        (lambda: perturb.Floaters(1.5, "count"), "must be a whole number"),
        (lambda: perturb.Floaters(distance=-1), "distance is -1"),
        (lambda: perturb.Floaters(size=0), "size is 0; it must be above 0"),
        (lambda: perturb.Unwelded(1.1), "at most 1"),
        (lambda: perturb.Quantisation(9.5), "must be a whole number"),
        (lambda: perturb.Quantisation(54), "at most 53"),
        (lambda: perturb.Quantisation(weld="maybe"), "weld is 'maybe'; it must be true or false"),
        (lambda: perturb.Flipped(1.1), "at most 1"),
        (lambda: perturb.Duplicates(1.1), "at most 1"),
        (lambda: perturb.Duplicates(winding="random"), "choose one of same, opposite"),
        (lambda: perturb.Slivers(1.1), "at most 1"),
        (lambda: perturb.Slivers(aspect=1.5), "aspect is 1.5; it must be at least 2"),
        (lambda: perturb.Slivers(aspect=1e7), r"at most 1e\+06"),
        (lambda: perturb.Welding(1.1), "at most 1"),
        (lambda: perturb.Welding(far=0), "far is 0; it must be above 0"),
        (lambda: perturb.Welding(0.2, "bounding_box_diagonal", far=0.2), "far must be at least 1.5 times amount"),
        (lambda: perturb.Welding(where="inside"), "choose one of any, external, internal"),
        (lambda: perturb.View(1.1), "at most 1"),
        (lambda: perturb.View(positions=0), "positions is 0; it must be above 0"),
        (lambda: perturb.View(positions=2.5), "must be a whole number"),
        (lambda: perturb.View(distance=0.5), "distance is 0.5; it must be above 0.5"),
        (lambda: perturb.View(max_incidence=91), "at most 90"),
        (lambda: perturb.Composite(1.1), "at most 1"),
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
def test_an_unusable_mesh_is_refused(perturbation, vertices, faces, message):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    with pytest.raises(PerturbationError, match=f"{perturbation.name}: the input mesh .*{message}"):
        perturbation(mesh, rng())


@pytest.mark.parametrize(
    ("perturbation", "message"),
    [
        (perturb.Holes(1, "share_of_triangles"), "the result has no face"),
        (perturb.Holes(911), "the result has fewer than 4 vertices"),
        (perturb.Holes(913), "913 triangles were requested, but the mesh has 912"),
        (perturb.Holes(487, "one_rings"), "487 one_rings were requested, but the mesh has 486"),
        (perturb.MissingParts(0.999), "the result has no face"),
        (perturb.Decimation(0.001), "the result"),
        (perturb.Scaling(1e308), "not finite"),
    ],
    ids=repr,
)
def test_an_unusable_result_is_refused(perturbation, message):
    with pytest.raises(PerturbationError, match=message):
        perturbation(bundled("ant"), rng())


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_the_shipped_config_names_every_field_with_its_default(path):
    config = OmegaConf.load(path)
    perturbation = hydra.utils.instantiate(config)
    assert perturbation == perturb.get(path.stem)()
    assert set(config) - {"_target_", "_convert_"} == {field.name for field in dataclasses.fields(perturbation)}
    level = hydra.utils.instantiate(config, amount=perturbation.neutral)
    assert level == dataclasses.replace(perturbation, amount=perturbation.neutral)


def test_every_shipped_perturbation_has_a_config_and_every_config_a_perturbation(own_registry):
    configured = {path.stem for path in CONFIGS}
    assert set(SHIPPED) <= configured <= set(perturb.names())


@pytest.fixture(scope="module")
def own(module_registry):
    """The module of an author's perturbations, which are registered during these tests only."""
    return import_module("tests.helpers.own_perturbations")


@pytest.mark.parametrize(("name", "fields"), [("Shift", ()), ("Stretch", (0.5, "factor"))])
def test_an_authors_own_perturbation_is_registered_and_conforms(name, fields, own):
    perturbation = getattr(own, name)(*fields)
    assert perturb.get(perturbation.name) is type(perturbation)
    assert perturbation.name in perturb.names()
    check_perturbation(perturbation)


def test_an_authors_own_perturbation_is_no_attribute_of_the_package(own):
    assert "shift" in perturb.names()
    assert not hasattr(perturb, "Shift")


def test_facts_that_are_numpy_scalars_become_plain_numbers(own):
    mesh = bundled("ant")
    applied = own.Shift(2.0)(mesh, rng()).applied
    assert type(applied["shift"]) is float
    assert applied["shift"] == 2 * perturb.LENGTHS["mean_edge_length"](mesh)


def test_arrays_of_trimesh_are_counterparts_too(own):
    mesh = bundled("ant")
    numbers = tracked_array(np.arange(len(mesh.vertices)))
    result = own.Shift().finish(mesh, mesh.copy(), numbers, largest=mesh.vertices.max())
    assert type(result.counterpart) is np.ndarray
    assert type(result.applied["largest"]) is float


def test_a_name_that_belongs_to_another_class_is_refused(own_registry):
    perturb.names()
    with pytest.raises(
        PerturbationError, match=r"Mine cannot have the name 'holes': it belongs to perturb\.holes\.Holes"
    ):

        class Mine(perturb.Holes):
            name = "holes"

    assert perturb.get("holes") is perturb.Holes


def test_a_class_that_inherits_its_name_is_not_registered(own_registry):
    class More(perturb.Holes):
        pass

    assert perturb.get("holes") is perturb.Holes
    assert More(3).name == "holes"


def test_a_class_defined_again_replaces_its_earlier_definition(own_registry):
    def define():
        class Again(perturb.Holes):
            name = "again"

        return Again

    first, second = define(), define()
    assert perturb.get("again") is second
    assert first is not second


@pytest.mark.parametrize("missing", ["name", "choices"])
def test_a_class_without_a_name_or_choices_cannot_be_instantiated(own_registry, missing):
    class Nameless(perturb.Perturbation):
        def apply(self, mesh, parameters):
            raise NotImplementedError

    if missing == "choices":
        Nameless.name = "nameless"
    with pytest.raises(PerturbationError, match=f"Nameless does not define '{missing}'"):
        Nameless(1.0, "count")


@pytest.mark.parametrize(
    ("counterpart", "message"),
    [
        (np.arange(485), r"shape \(485,\) and type int64; expected shape \(486,\)"),
        (np.arange(486.0), r"type float64; expected shape \(486,\) and integers"),
        (np.arange(486) + 1, r"values from 1 to 486; they must be indices of the 486 vertices"),
        (np.arange(486) - 2, r"values from -2 to 483"),
    ],
)
def test_a_counterpart_that_does_not_fit_the_meshes_is_a_mistake_of_the_author(counterpart, message, own):
    mesh = bundled("ant")
    with pytest.raises(ValueError, match=message) as error:
        own.Shift().finish(mesh, mesh.copy(), counterpart)
    assert not isinstance(error.value, PerturbationError)
