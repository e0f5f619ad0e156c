"""A method of the user's own, as options describe it."""

import pickle

import numpy as np
import pytest
from omegaconf import OmegaConf

import heatwalk
from studies import segmenters
from studies.execution import Local, map_ordered
from studies.segmenters import HeatWalk, SegmenterError, make_segmenter
from studies.segmenters.segmenter import _method
from tests.helpers.meshes import bundled

MINE = """
import numpy as np

def halves(vertices, faces, axis=0):
    return (vertices[:, axis] > np.median(vertices[:, axis])).astype(int)

def halves_of_faces(vertices, faces):
    centres = vertices[faces].mean(axis=1)
    vertices[:] = 0
    return (centres[:, 0] > 0).astype(int)

def timed(vertices, faces, time=5.0):
    return np.full(len(vertices), int(time))

def fails(vertices, faces):
    raise RuntimeError("no legs")

class Parts:
    name = "my parts"

    def __init__(self, k, weights=(1,)):
        if k < 1:
            raise ValueError(f"segmenter.k is {k}: give at least 1")
        self.label = lambda i: i % k  # cannot be pickled
        assert isinstance(weights, list | tuple)

    def __call__(self, vertices, faces):
        return np.array([self.label(i) for i in range(len(vertices))])

class Uncallable:
    pass
"""


@pytest.fixture(scope="module")
def ant():
    mesh = bundled("ant")
    return np.asarray(mesh.vertices) - mesh.vertices.mean(axis=0), np.asarray(mesh.faces)


@pytest.fixture
def mine(own_modules, monkeypatch):
    """The current folder, with a module my_methods of the user's own, which is nowhere else on the path."""
    (own_modules / "my_methods.py").write_text(MINE)
    monkeypatch.chdir(own_modules)
    yield own_modules
    _method.cache_clear()


def made(composed, *overrides):
    return make_segmenter(OmegaConf.to_container(composed(*overrides).segmenter, resolve=True))


def test_the_heat_walk_returns_its_own_labels(composed, ant):
    segmenter = made(composed, "segmenter.time=0.5")
    assert (segmenter(*ant) == HeatWalk(0.5)(*ant)).all()
    assert segmenter.name == "HeatWalk (time=0.5)"
    assert made(composed).name == "HeatWalk"
    options = {"_target_": "studies.segmenters.HeatWalk", "time": 0.5, "time_unit": "paper", "density": "vertices"}
    assert segmenter.fingerprint == [options | {"split_dissipators": False}, heatwalk.ALGORITHM_VERSION]


def test_a_function_is_called_with_its_options_and_gives_the_segmenter_its_name(mine, composed, ant):
    assert (
        made(composed, "segmenter._target_=my_methods.halves")(*ant) == (ant[0][:, 0] > np.median(ant[0][:, 0]))
    ).all()
    segmenter = made(composed, "segmenter._target_=my_methods.halves", "+segmenter.axis=2")
    assert (segmenter(*ant) == (ant[0][:, 2] > np.median(ant[0][:, 2]))).all()
    assert segmenter.name == "halves (axis=2)"


@pytest.mark.parametrize("group", [[], ["segmenter=custom"]])
def test_the_segmenter_is_the_same_with_and_without_the_group_custom(group, mine, composed):
    words = ["segmenter._target_=my_methods.halves", "+segmenter.axis=1"]
    assert made(composed, *group, *words) == made(composed, *words)


def test_a_method_may_label_faces_and_modify_the_mesh(mine, composed, ant):
    vertices = ant[0].copy()
    labels = made(composed, "segmenter=custom", "segmenter._target_=my_methods.halves_of_faces")(vertices, ant[1])
    assert (vertices == ant[0]).all()
    far = np.abs(vertices[:, 0]) > np.linalg.norm(np.ptp(vertices[ant[1]], axis=1), axis=1).max()
    assert (labels[far] == (vertices[far, 0] > 0)).all()


def test_a_class_is_instantiated_once_per_process_and_need_not_be_picklable(mine, composed, ant):
    segmenter = made(composed, "segmenter=custom", "segmenter._target_=my_methods.Parts", "+segmenter.k=3",
                     "+segmenter.weights=[1,2]")  # fmt: skip
    assert segmenter.name == "my parts (k=3, weights=[1, 2])"
    assert (pickle.loads(pickle.dumps(segmenter))(*ant) == np.arange(486) % 3).all()


def test_a_worker_finds_the_method_too(mine, composed, ant):
    segmenter = made(composed, "segmenter._target_=my_methods.halves")
    (labels,) = map_ordered(Local(workers=1), segmented, [(segmenter, ant)])
    assert (labels == segmenter(*ant)).all()


def segmented(task):
    segmenter, mesh = task
    return segmenter(*mesh)


def test_an_option_that_the_heat_walk_has_too_needs_the_group_custom(mine, composed, ant):
    for words in (["my_methods.timed"], ["my_methods.halves", "segmenter.time=2"]):
        with pytest.raises(SegmenterError, match=r"add segmenter=custom, and \+segmenter.time="):
            made(composed, f"segmenter._target_={words[0]}", *words[1:])
    words = ["segmenter=custom", "segmenter._target_=my_methods.timed"]
    assert (made(composed, *words)(*ant) == 5).all()
    assert (made(composed, *words, "+segmenter.time=1.0")(*ant) == 1).all()


def test_other_code_in_the_module_is_another_method(mine, composed):
    words = ["segmenter._target_=my_methods.halves"]
    before = made(composed, *words)
    assert made(composed, *words).fingerprint == before.fingerprint
    (mine / "my_methods.py").write_text(MINE.replace("np.median", "np.mean"))
    assert made(composed, *words).fingerprint != before.fingerprint


def test_other_code_anywhere_in_the_package_is_another_method(mine, composed):
    package = mine / "my_package"
    package.mkdir()
    (package / "__init__.py").write_text("from my_package.methods import method\n")
    (package / "methods.py").write_text("from my_package.parts import method\n")
    (package / "parts.py").write_text("def method(vertices, faces):\n    return [0] * len(vertices)\n")
    words = ["segmenter._target_=my_package.method"]
    before = made(composed, *words).fingerprint
    with (package / "methods.py").open("a") as file:
        file.write("# changed\n")
    assert made(composed, *words).fingerprint != before


def test_what_a_method_raises_is_raised(mine, composed, ant):
    with pytest.raises(RuntimeError, match="no legs"):
        made(composed, "segmenter._target_=my_methods.fails")(*ant)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["segmenter=custom"], "^segmenter._target_ is required: segmenter._target_=my_package.my_method$"),
        (["segmenter=external"], r"^segmenter.command is required: segmenter.command='mytool \{mesh\} \{labels\}'$"),
        (["segmenter._target_=no_such.method"], "No module named 'no_such'"),
        (["segmenter._target_=my_methods.quarters"], "no attribute 'quarters'"),
        (["segmenter._target_=my_methods.np"], "is a module and cannot be called"),
        (["segmenter._target_=my_methods.Uncallable"], "cannot be called with"),
        (["segmenter._target_=my_methods.halves", "+segmenter.k=5"], r"\(vertices, faces, k=5\): .*'k'"),
        (["segmenter._target_=my_methods.Parts", "+segmenter.k=0"], "^segmenter.k is 0: give at least 1$"),
        (["segmenter._target_=my_methods.Parts"], "missing 1 required positional argument: 'k'"),
        (["segmenter._target_=my_methods.halves", "+segmenter.labels_of=edges"], "labels_of is 'edges'"),
    ],
)  # fmt: skip
def test_options_that_describe_no_method_are_refused_before_anything_runs(overrides, message, mine, composed):
    with pytest.raises(SegmenterError, match=message):
        made(composed, *overrides)


RECIPE = """
class Slices:
    algorithm_version = 3

    def __init__(self, n=2):
        self.n = n

    def __call__(self, vertices, faces):
        return (vertices[:, 0] > 0).astype(int) * (self.n - 1)


class Unversioned(Slices):
    algorithm_version = None


def slices(vertices, faces):
    return (vertices[:, 0] > 0).astype(int)


def versioned(vertices, faces):
    return slices(vertices, faces)


versioned.algorithm_version = 7
"""


@pytest.fixture
def recipe(own_modules, monkeypatch):
    """A module slices in the package studies.segmenters, as the recipe for a segmenter of the project adds it."""
    (own_modules / "slices.py").write_text(RECIPE)
    monkeypatch.setattr(segmenters, "__path__", [*segmenters.__path__, str(own_modules)])
    yield
    _method.cache_clear()


def test_a_module_in_the_package_is_a_segmenter_without_editing_another_file(recipe, ant):
    segmenter = make_segmenter({"_target_": "studies.segmenters.slices.Slices", "n": 5})
    assert (segmenter(*ant) == 4 * (ant[0][:, 0] > 0)).all()
    assert segmenter.fingerprint == [{"_target_": "studies.segmenters.slices.Slices", "n": 5}, 3]


def test_a_function_in_the_project_may_declare_its_version_as_an_attribute(recipe):
    assert make_segmenter({"_target_": "studies.segmenters.slices.versioned"}).version == 7


@pytest.mark.parametrize("name", ["Unversioned", "slices"])
def test_a_method_in_the_project_without_a_version_is_refused(recipe, name):
    message = rf"^segmenter._target_=studies.segmenters.slices.{name} is part of this project and must declare algor"
    with pytest.raises(SegmenterError, match=message):
        make_segmenter({"_target_": f"studies.segmenters.slices.{name}"})


def test_an_option_that_names_a_target_becomes_an_instance_of_it(mine, ant):
    options = {"_target_": "my_methods.halves", "axis": {"_target_": "builtins.int"}}
    assert (make_segmenter(options)(*ant) == make_segmenter({"_target_": "my_methods.halves"})(*ant)).all()


def test_options_that_json_cannot_represent_are_refused(mine):
    with pytest.raises(SegmenterError, match=r"options of segmenter\._target_=my_methods.halves must be plain values"):
        make_segmenter({"_target_": "my_methods.halves", "axis": np.int64(1)})
