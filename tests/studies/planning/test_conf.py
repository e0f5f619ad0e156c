import dataclasses
import functools
from pathlib import Path

import hydra.utils
import numpy as np
import pandas as pd
import pytest
import trimesh
import yaml
from omegaconf import OmegaConf

import conf
import perturb
from studies import segmenters
from studies.execution import map_ordered
from studies.experiments import Change
from studies.planning.configuration import instantiate_experiment
from studies.planning.errors import StudyError
from studies.reporting.publication import Publication
from studies.testing import example_meshes
from tests.helpers.meshes import DATA, bundled, coarse

CONF = Path(conf.__file__).parent
PAPER = DATA.parent / "paper"
STUDIES = sorted(path.stem for path in (CONF / "study").glob("*.yaml") if path.stem != "custom")


def names(group):
    return sorted(path.stem for path in (CONF / group).glob("*.yaml"))


@functools.cache
def cow():
    """The cow with a third of its faces, which suffice for every level."""
    return coarse(bundled("cow"), 2000)


@functools.cache
def perturbed_cow(perturbation):
    """The cow under a perturbation, which several studies may have."""
    return perturbation(cow(), np.random.default_rng(0))


@pytest.mark.parametrize("study", STUDIES)
def test_every_study_composes_and_its_perturbation_works_at_every_level(study, configured):
    made = configured(f"+study={study}", "engine=serial")
    assert made.name == study
    assert made.title
    for name, part in made.experiment.named_parts(study).items() if isinstance(made.experiment, Change) else ():
        assert part.title
        assert part.axis
        for level, perturbation in part.at_levels(name):
            assert getattr(perturbation, part.swept) == level
            result = perturbed_cow(perturbation)
            assert isinstance(result.mesh, trimesh.Trimesh)
            assert result.counterpart.shape == (len(cow().vertices),)


@pytest.mark.parametrize("study", STUDIES)
def test_the_stored_configuration_makes_the_same_experiment(study, configured):
    made = configured(f"+study={study}", "engine=serial")
    stored = yaml.safe_load(yaml.safe_dump(dict(made.record)))
    assert instantiate_experiment(stored) == made.experiment


def test_a_study_of_ones_own_kind_needs_a_name_and_a_class(configured):
    with pytest.raises(StudyError, match=r"study\.name is required"):
        configured("+study=custom")
    with pytest.raises(StudyError, match=r"experiment\._target_ is required"):
        configured("+study=custom", "study.name=mine")


@pytest.mark.parametrize("name", names("perturbation"))
def test_every_perturbation_config_names_every_field_of_its_class(name):
    cfg = OmegaConf.load(CONF / "perturbation" / f"{name}.yaml")
    made = hydra.utils.instantiate(cfg)
    assert type(made) is perturb.get(name)
    assert set(cfg) - {"_target_", "_convert_"} == {field.name for field in dataclasses.fields(made)}


def test_every_perturbation_with_a_config_has_a_study(configured):
    used = set()
    for study in STUDIES:
        experiment = configured(f"+study={study}", "engine=serial").experiment
        if isinstance(experiment, Change):
            parts = experiment.named_parts(study).items()
            used |= {perturbation.name for name, part in parts for _, perturbation in part.at_levels(name)}
    assert set(names("perturbation")) <= used <= set(perturb.names())


# These two need a program or a method; tests/studies/segmenters has them.
@pytest.mark.parametrize("name", sorted(set(names("segmenter")) - {"custom", "external"}))
def test_every_segmenter_config_gives_a_label_for_every_vertex(name, composed):
    options = OmegaConf.to_container(composed("+study=holes", f"segmenter={name}").segmenter)
    segmenter = segmenters.make_segmenter(options)
    # The decomposition into convex parts takes seconds on the ant.
    mesh = example_meshes()["ellipsoid"] if name == "convex_decomposition" else bundled("ant")
    labels = segmenter(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    assert labels.shape == (len(mesh.vertices),)
    assert labels.dtype.kind == "i"


# A dask scheduler has to exist first; tests/studies/execution/test_dask.py has one.
@pytest.mark.parametrize("name", sorted(set(names("engine")) - {"dask"}))
def test_every_engine_config_runs_every_task(name, composed):
    engine = hydra.utils.instantiate(composed("+study=holes", f"engine={name}").engine)
    assert map_ordered(engine, abs, [-1, 2, -3]) == [1, 2, 3]


@pytest.mark.parametrize("name", sorted(set(names("dataset")) - {"custom"}))
def test_every_dataset_config_makes_its_dataset(name, composed):
    expected = name.removesuffix("_coarse")  # the same models with fewer vertices
    assert hydra.utils.instantiate(composed("+study=holes", f"dataset={name}").dataset).name == expected


def test_no_config_file_repeats_another():
    contents = [path.read_text() for path in CONF.rglob("*.yaml")]
    assert len(set(contents)) == len(contents)


def test_the_published_values_are_those_of_the_papers_table_2():
    if not PAPER.exists():
        pytest.skip(f"the paper's tables are not available: {PAPER} does not exist")
    publication = Publication.load("heat_walk_2011")
    table = pd.read_csv(PAPER / "table2.csv")
    for study, rows in table.groupby("perturbation"):
        (entry,) = [e for e in publication._data["values"] if e.get("where") == {"part": study}]
        scale = 0.01 if rows["level_unit"].iloc[0].startswith("percent") else 1
        expected = {
            round(level * scale, 6): cp for level, cp in zip(rows["level"], rows["change_percentage"], strict=True)
        }
        assert {round(float(level), 6): cp for level, cp in entry["values"].items()} == expected


def test_every_study_of_the_publication_exists_and_every_value_is_about_one():
    data = Publication.load("heat_walk_2011")._data
    assert set(data["studies"]) <= set(STUDIES)
    parts = {entry["where"]["part"] for entry in data["values"] if "part" in entry.get("where", {})}
    assert parts <= set(STUDIES)
