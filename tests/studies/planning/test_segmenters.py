"""The options ``segmenters`` and ``reference_segmenter``."""

import json
from pathlib import Path

import pytest
import yaml

import conf
from studies.planning.errors import StudyError

FILES = sorted((Path(conf.__file__).parent / "segmenter").glob("*.yaml"))
READY = [file.stem for file in FILES if "???" not in yaml.safe_load(file.read_text(encoding="utf-8")).values()]
STUDY = ("+study=holes", "dataset.models=[ant]", "engine=serial")


@pytest.fixture
def targets(configured):
    """A function: overrides -> the target of each segmenter, in their order."""
    return lambda *words: [json.loads(each.recipe)["_target_"] for each in segmenters(configured, words)]


def segmenters(configured, words):
    return configured(*STUDY, *words).segmenters


def target_of(name):
    (file,) = (file for file in FILES if file.stem == name)
    return yaml.safe_load(file.read_text(encoding="utf-8"))["_target_"]


def test_all_is_every_method_that_needs_no_further_options(targets):
    assert targets("segmenters=all") == [target_of(name) for name in READY]
    assert {"custom", "external"}.isdisjoint(READY)


def test_methods_that_are_named_too_are_not_there_twice(targets):
    others = [name for name in READY if name not in ("voronoi", "heat_walk")]
    expected = ["voronoi", *others, "heat_walk"]
    assert targets("segmenters=[voronoi,all,heat_walk]") == [target_of(name) for name in expected]


def test_methods_of_ones_own_join_all_of_them(targets):
    own = "tests.helpers.segmenting.halves"
    assert targets(f"segmenters=[all,{own}]") == [*(target_of(name) for name in READY), own]


def test_options_of_the_chosen_method_hold_among_all(configured):
    names = [each.name for each in segmenters(configured, ("segmenters=all", "segmenter.time=2"))]
    assert names.count("HeatWalk (time=2)") == 1
    assert "HeatWalk" not in names


def test_a_list_in_the_configuration_is_the_methods_in_it(configured):
    listed = yaml.safe_load((FILES[0].parents[1] / "methods" / "ablation.yaml").read_text(encoding="utf-8"))
    names = [each.name for each in segmenters(configured, ("segmenters=ablation",))]
    assert names[:2] == ["HeatWalk", "HeatWalkRobust"]
    assert len(names) == len(listed["segmenters"])
    among = [each.name for each in segmenters(configured, ("segmenters=[voronoi,ablation]",))]
    assert among == ["Voronoi", *names]


@pytest.mark.parametrize("value", ["some", "[]", "5"])
def test_what_is_neither_a_list_nor_all_is_refused(configured, value):
    with pytest.raises(StudyError, match=r"^segmenters is .*: it must be a list, .* or one of all, ablation$"):
        segmenters(configured, (f"segmenters={value}",))


def test_the_reference_is_the_heat_walk_or_the_one_that_is_named(configured):
    assert segmenters(configured, ("segmenter=voronoi",))[0].reference.name == "HeatWalk"
    named = segmenters(configured, ("segmenters=[voronoi,heat_walk]", "reference_segmenter=one_segment"))
    assert [each.reference and each.reference.name for each in named] == ["OneSegment", None]
    own = segmenters(configured, ("segmenter=voronoi", "reference_segmenter=tests.helpers.segmenting.by_size"))
    assert own[0].reference.name == "by_size"


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("voronoi", r"^reference_segmenter=Voronoi must itself be told .* such as heat_walk$"),
        ("nothing", r"^reference_segmenter is 'nothing', which is neither one of .* nor a dotted name"),
    ],
)
def test_a_reference_that_has_to_be_told_or_does_not_exist_is_refused(configured, value, message):
    with pytest.raises(ValueError, match=message):
        segmenters(configured, ("segmenter=voronoi", f"reference_segmenter={value}"))
