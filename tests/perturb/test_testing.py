"""The conformance suite finds every kind of mistake and reports what, where and why."""

import random
from importlib import import_module

import numpy as np
import pytest
import trimesh

import perturb
from perturb import testing
from perturb.testing import check_perturbation, default_meshes
from tests.helpers.meshes import bundled

BROKEN = [
    ("NameInherited", "has no name of its own"),
    ("BadVersion", r"version is 0; it must be a whole number of at least 1"),
    ("BadNeutral", "neutral is nan"),
    ("BadLaterFields", r"later_fields is \('amuont',\); it must be a tuple of names of fields that have a default"),
    ("UnitNotListed", r"the unit 'mean_edge_length' is not in choices\['unit'\]"),
    ("NotPicklable", "cannot be pickled, as needed for worker processes"),
    ("NotComparable", "differs from a perturbation equal to it"),
    ("UncheckedAmount", r"UncheckedAmount with amount=-1: was accepted; it must raise PerturbationError"),
    ("UncheckedField", r"UncheckedField with extent=nan: was accepted.*self\.check_number\('extent'\)"),
    ("FieldRaisesAnotherError", r"style='no such choice': raised KeyError: .*it must raise PerturbationError"),
    ("UnusableMeshAccepted", "on a mesh without faces: was accepted"),
    ("UnusableMeshRaisesAnotherError", "on a mesh without faces: raised IndexError"),
    ("RaisesAnotherError", "on the mesh 'pipe': raised KeyError: 'something'"),
    ("Refuses", "raised PerturbationError: refuses: too little; choose another amount, or pass meshes that allow it"),
    ("ReturnsTuple", r"returned a tuple; return self\.finish"),
    ("MeshOfAnotherType", "the resulting mesh is a PointCloud"),
    ("NotFinite", "1 vertices of the result are not finite"),
    ("NoFaces", "the result has no face"),
    ("FacesOutOfRange", "faces of the result refer to vertices 1 to 896, but it has 896 vertices"),
    ("InputChanged", "the input mesh was changed"),
    ("InputReordered", "the input mesh was changed"),
    ("FacesShared", "shares its faces with the input mesh"),
    ("VerticesShared", "shares its vertices with the input mesh"),
    ("CounterpartOfAnotherType", "counterpart is not an int64 array but int32"),
    ("CounterpartOfTheResult", r"counterpart has the shape \(895,\), expected \(896,\)"),
    ("CounterpartOutOfRange", "counterpart has values from 1 to 896; the result has 896 vertices"),
    ("CounterpartBelowMinusOne", "counterpart has values from -2 to 893"),
    ("CounterpartNotInjective", "896 vertices have a counterpart, but these are only 448 different vertices"),
    ("Processed", "on the mesh 'torn pipe': raised ValueError: processed: counterpart has values from 0 to 932"),
    ("AppliedWithArray", r"applied\['indices'\] is array\(\[0, 1, 2\]\), a ndarray"),
    ("AppliedWithNumpyScalar", r"applied\['share'\] is np\.float64\(0\.5\), a float64"),
    ("AppliedWithNan", "applied cannot be written as JSON"),
    ("AppliedWithIntegerKey", "applied does not survive JSON; its keys must be strings"),
    ("AppliedWithoutUnit", r"applied\['unit'\] is 'missing', expected 'mean_edge_length'"),
    ("AppliedWithAnotherAmount", r"applied\['amount'\] is 7\.0, expected 0\.1"),
    ("AppliedWithWrongCount", r"applied\['faces_after'\] is 1, expected 1792"),
    ("ResultNotPicklable", "raised .*lambda"),
    ("GlobalNumpyUsed", r"used the global random numbers of numpy\.random;"),
    ("GlobalRandomSeeded", "used the global random numbers of random;"),
    ("SeedIgnored", "two runs with the seed 0 yield different results"),
    ("DependsOnEarlierCalls", "two runs with the seed 0 yield different results"),
    ("RandomApply", "two runs with the seed 0 yield different results"),
    ("CallIsNotSampleAndApply", "apply with the parameters of sample yields another result than calling"),
    ("ParametersChanged", "apply changed its parameters"),
    ("KeepsWhatItApplied", "apply with the parameters of sample yields another result than calling"),
    ("ParametersNotADict", "sample returned a ndarray"),
    ("NotNeutral", r"at the neutral amount 0\.0 the mesh or its order of vertices and faces changes"),
    ("ReordersWhenNeutral", r"at the neutral amount 0\.0 the mesh or its order of vertices and faces changes"),
    ("Absolute", "the mesh scaled by 7.88861e-31 is perturbed differently"),
]


@pytest.fixture(scope="module")
def examples(module_registry):
    """The module of the broken perturbations, which are registered during these tests only."""
    return import_module("tests.helpers.broken_perturbations")


def test_a_sound_perturbation_passes(examples):
    check_perturbation(examples.Sound())


@pytest.mark.parametrize(("name", "message"), BROKEN, ids=[name for name, _ in BROKEN])
def test_a_mistake_is_found_and_described(name, message, examples):
    with pytest.raises(AssertionError, match=message) as error:
        check_perturbation(getattr(examples, name)())
    assert name in str(error.value)
    assert "\n" not in str(error.value)


def test_what_a_perturbation_keeps_is_found_on_a_single_mesh_too(examples):
    with pytest.raises(AssertionError, match="apply with the parameters of sample yields another result"):
        check_perturbation(examples.KeepsWhatItApplied(), [trimesh.creation.icosphere()])


def test_every_contract_is_violated_by_a_broken_perturbation(examples):
    checks = {check.__name__ for check in (*testing._CHECKS_WITHOUT_A_MESH, *testing._CHECKS_ON_A_MESH)}
    failing = set()
    for name, _ in BROKEN:
        with pytest.raises(AssertionError) as error:
            check_perturbation(getattr(examples, name)())
        failing |= {entry.name for entry in error.traceback}
    assert checks <= failing


def test_a_function_is_not_a_perturbation():
    with pytest.raises(AssertionError, match=r"is not an instance of a subclass of perturb\.Perturbation"):
        check_perturbation(lambda mesh, rng: mesh)


def test_the_neutral_amount_is_refused_because_it_shows_nothing(examples):
    with pytest.raises(AssertionError, match="the amount 0 is the neutral one"):
        check_perturbation(examples.Sound(0))


def test_a_class_whose_name_was_taken_over_is_found(examples, monkeypatch):
    monkeypatch.setitem(perturb.perturbation._REGISTRY, "sound", perturb.Holes)
    with pytest.raises(AssertionError, match="the name 'sound' is registered for another class"):
        check_perturbation(examples.Sound())


def test_shared_counterparts_are_allowed_if_applied_specifies_how_they_were_found():
    check_perturbation(perturb.Decimation(0.4, backend="pymeshlab"))


def test_meshes_can_be_passed_with_and_without_labels():
    tetrahedron = perturb.as_trimesh(np.eye(4, 3), [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    with pytest.raises(AssertionError, match=r"on the mesh '1': .*58 triangles were requested, but the mesh has 4"):
        check_perturbation(perturb.Holes(58), [bundled("ant"), tetrahedron])
    with pytest.raises(AssertionError, match="on the mesh 'small': "):
        check_perturbation(perturb.Holes(58), {"small": tetrahedron})


def test_an_empty_collection_of_meshes_is_refused(examples):
    with pytest.raises(ValueError, match="meshes is empty"):
        check_perturbation(examples.Sound(), [])


def test_the_passed_meshes_are_left_unchanged_even_by_a_broken_perturbation(examples):
    mesh = bundled("ant")
    before = np.array(mesh.vertices)
    with pytest.raises(AssertionError, match="the input mesh was changed"):
        check_perturbation(examples.InputChanged(), [mesh])
    np.testing.assert_array_equal(mesh.vertices, before)


def test_the_default_meshes_have_a_boundary_components_duplicates_and_an_unreferenced_vertex():
    pipe, spheres, torn = default_meshes().values()
    assert pipe.is_watertight
    assert pipe.euler_number == 0
    assert (spheres.is_watertight, spheres.euler_number) == (True, 4)
    assert not torn.is_watertight
    assert np.setdiff1d(np.arange(len(torn.vertices)), torn.faces).tolist() == [0]
    assert len(np.unique(torn.vertices, axis=0)) < len(torn.vertices)
    assert len(trimesh.graph.connected_components(torn.edges_unique)) == 2


def test_the_default_meshes_are_the_same_every_time():
    for first, second in zip(default_meshes().values(), default_meshes().values(), strict=True):
        np.testing.assert_array_equal(first.vertices, second.vertices)
        np.testing.assert_array_equal(first.faces, second.faces)


def test_the_global_generators_are_restored_even_after_a_perturbation_that_seeds_them(examples):
    random.seed(1)
    np.random.seed(1)  # noqa: NPY002
    before = random.getstate(), np.random.get_state()[1].tolist()  # noqa: NPY002
    for broken in (examples.GlobalRandomSeeded(), examples.GlobalNumpyUsed()):
        with pytest.raises(AssertionError, match="used the global random numbers"):
            check_perturbation(broken, [bundled("ant")])
    assert (random.getstate(), np.random.get_state()[1].tolist()) == before  # noqa: NPY002
