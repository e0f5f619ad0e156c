import dataclasses
from pathlib import Path

import hydra.utils
import numpy as np
import pandas as pd
import pytest
import trimesh
from omegaconf import OmegaConf

import conf
import perturb
from studies import segmenters
from studies.execution import map_ordered
from studies.experiments.change import parts
from tests.helpers.meshes import DATA, bundled

CONF = Path(conf.__file__).parent
PAPER = DATA.parent / "paper"
STUDIES = sorted(path.stem for path in (CONF / "study").glob("*.yaml"))


def names(group):
    return sorted(path.stem for path in (CONF / group).glob("*.yaml"))


@pytest.mark.parametrize("study", STUDIES)
def test_every_study_composes_and_its_perturbation_works_at_every_level(study, composed):
    cfg = composed(f"+study={study}")
    assert cfg.study.name == study
    assert cfg.repeats >= 1
    assert cfg.title
    mesh = bundled("cow")
    for part in parts(cfg).values() if cfg.experiment._target_.endswith(".Change") else ():
        for level in part.levels:
            perturbation = hydra.utils.instantiate(part.perturbation, **{part.swept: level})
            assert getattr(perturbation, part.swept) == level
            result = perturbation(mesh, np.random.default_rng(0))
            assert isinstance(result.mesh, trimesh.Trimesh)
            assert result.counterpart.shape == (len(mesh.vertices),)


@pytest.mark.parametrize("name", names("perturbation"))
def test_every_perturbation_config_names_every_field_of_its_class(name):
    cfg = OmegaConf.load(CONF / "perturbation" / f"{name}.yaml")
    made = hydra.utils.instantiate(cfg)
    assert type(made) is perturb.get(name)
    assert set(cfg) - {"_target_"} == {field.name for field in dataclasses.fields(made)}


def test_every_registered_perturbation_has_a_config_and_a_study():
    assert set(names("perturbation")) == set(perturb.names())
    assert set(perturb.names()) <= set(STUDIES)


# These two need a program or a method; tests/studies/segmenters has them.
@pytest.mark.parametrize("name", sorted(set(names("segmenter")) - {"custom", "external"}))
def test_every_segmenter_config_gives_a_label_for_every_vertex(name, composed):
    segmenter = segmenters.make(composed("+study=holes", f"segmenter={name}").segmenter)
    mesh = bundled("ant")
    labels = segmenter(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    assert labels.shape == (len(mesh.vertices),)
    assert labels.dtype.kind == "i"


# A dask scheduler has to be there first; tests/studies/test_cluster.py has one.
@pytest.mark.parametrize("name", sorted(set(names("engine")) - {"dask"}))
def test_every_engine_config_runs_every_task(name, composed):
    engine = hydra.utils.instantiate(composed("+study=holes", f"engine={name}").engine)
    assert map_ordered(engine, abs, [-1, 2, -3]) == [1, 2, 3]


@pytest.mark.parametrize("name", names("dataset"))
def test_every_dataset_config_makes_its_dataset(name, composed):
    assert hydra.utils.instantiate(composed("+study=holes", f"dataset={name}").dataset).name == name


def test_the_papers_figures_in_the_studies_are_those_of_table_2(composed):
    if not PAPER.exists():
        pytest.skip(f"the paper's tables are not at hand: no {PAPER}")
    table = pd.read_csv(PAPER / "table2.csv")
    for study, rows in table.groupby("perturbation"):
        paper = composed(f"+study={study}").paper
        scale = 0.01 if rows["level_unit"].iloc[0].startswith("percent") else 1
        expected = {
            round(level * scale, 6): cp for level, cp in zip(rows["level"], rows["change_percentage"], strict=True)
        }
        assert {round(float(level), 6): cp for level, cp in paper.items()} == expected
