import dataclasses
from pathlib import Path

import numpy as np
import pytest
import yaml

import conf
import heatwalk
from heatwalk.numerics.threads import number_of_threads
from heatwalk.spectrum import SpectrumSolver
from studies.segmenters import HeatWalk, SegmenterError, make_segmenter
from studies.segmenters.heat_walk_robust import PARTS, HeatWalkParts, HeatWalkRobust
from studies.testing import check_segmenter
from tests.helpers.meshes import bundled

FOLDER = Path(conf.__file__).parent
OFF = dict.fromkeys(PARTS, False) | {"density": "vertices"}


@pytest.fixture(scope="module")
def ant():
    mesh = bundled("ant")
    return np.array(mesh.vertices), np.array(mesh.faces)


def test_it_is_a_segmenter():
    check_segmenter(HeatWalkRobust())


@pytest.mark.parametrize("segmenter", [HeatWalk(), HeatWalkRobust()], ids=type)
def test_in_a_study_one_thread_works_on_a_mesh_as_others_may_work_on_other_meshes(segmenter, ant, monkeypatch):
    used, up_to = [], SpectrumSolver.up_to

    def recorded(solver, limit):
        used.append(number_of_threads())
        return up_to(solver, limit)

    monkeypatch.setattr(SpectrumSolver, "up_to", recorded)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    segmenter(*ant)
    assert set(used) == {1}


def test_without_its_parts_it_is_the_heat_walk(ant):
    assert np.array_equal(HeatWalkRobust(**OFF)(*ant), HeatWalk()(*ant))


def test_its_labels_are_those_of_the_function_with_dissipators_as_minus_one(ant):
    result = heatwalk.segment_robust(*ant)
    assert np.array_equal(HeatWalkRobust()(*ant), np.where(result.dissipates, -1, result.labels))
    assert np.array_equal(next(iter(HeatWalkRobust().at_times(*ant, [1.0]))), HeatWalkRobust()(*ant))


def test_its_configuration_lists_every_option_with_its_default():
    options = yaml.safe_load((FOLDER / "segmenter" / "heat_walk_robust.yaml").read_text())
    assert options.pop("_target_") == "studies.segmenters.heat_walk_robust.HeatWalkRobust"
    assert options == {field.name: field.default for field in dataclasses.fields(HeatWalkRobust)}
    assert make_segmenter({"_target_": "studies.segmenters.heat_walk_robust.HeatWalkRobust"} | options).name == (
        "HeatWalkRobust"
    )


def test_with_parts_it_is_the_robust_variant_with_both_switches(ant):
    options = yaml.safe_load((FOLDER / "segmenter" / "heat_walk_parts.yaml").read_text())
    del options["defaults"]
    parts = make_segmenter(options)
    assert parts.name == HeatWalkParts().name == "HeatWalkParts"
    assert np.array_equal(HeatWalkParts()(*ant), HeatWalkRobust(refine=True, hierarchy=True)(*ant))
    assert not np.array_equal(HeatWalkParts()(*ant), HeatWalkRobust()(*ant))


def test_an_invalid_option_is_refused_by_its_name():
    with pytest.raises(SegmenterError, match=r"segmenter\.persistence is 2: it must be above 0 and at most 1"):
        make_segmenter({"_target_": "studies.segmenters.heat_walk_robust.HeatWalkRobust", "persistence": 2})


def test_the_ablation_has_each_part_alone_all_but_each_and_what_is_off_otherwise():
    entries = yaml.safe_load((FOLDER / "methods" / "ablation.yaml").read_text())["segmenters"]
    assert entries[:2] == ["heat_walk", "heat_walk_robust"]
    methods = [HeatWalkRobust(**{k: v for k, v in entry.items() if k != "_target_"}) for entry in entries[2:]]
    whole, nothing = HeatWalkRobust(), HeatWalkRobust(**OFF)
    switches = dict.fromkeys(PARTS, True) | {"density": "area"}
    alone = [dataclasses.replace(nothing, **{part: value}) for part, value in switches.items()]
    missing = [dataclasses.replace(whole, **{part: OFF[part]}) for part in switches]
    added = [{"refine": True}, {"hierarchy": True}, {"refine": True, "hierarchy": True}]
    assert methods == alone + missing + [dataclasses.replace(whole, **options) for options in added]
    names = [method.name for method in methods]
    assert len({*names, whole.name}) == len(methods) + 1
