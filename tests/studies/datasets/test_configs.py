import pytest
from hydra import compose, initialize_config_module
from hydra.utils import instantiate

from studies.datasets.bundled import Bundled
from studies.datasets.files import Files
from studies.datasets.psb import NON_RIGID, PSB
from studies.datasets.tosca import TOSCA


def dataset(*overrides):
    with initialize_config_module("conf", version_base="1.3"):
        return instantiate(compose(overrides=list(overrides)).dataset)


@pytest.mark.parametrize(("name", "kind"), [("bundled", Bundled), ("files", Files), ("psb", PSB), ("tosca", TOSCA)])
def test_each_config_makes_its_dataset_without_looking_for_files(name, kind, monkeypatch):
    for variable in ("PSB_ROOT", "TOSCA_ROOT"):
        monkeypatch.delenv(variable, raising=False)
    made = dataset(f"+dataset={name}")
    assert type(made) is kind
    assert made.name == name


def test_options_from_the_command_line_choose_the_models(psb_zip):
    chosen = dataset(
        "+dataset=psb", f"dataset.root={psb_zip}", "dataset.categories=[Human,Ant]", "dataset.models=[84,3]"
    )
    assert [model.name for model in chosen.models()] == ["3", "84"]


def test_the_environment_says_where_the_benchmark_is(psb_zip, monkeypatch):
    monkeypatch.setenv("PSB_ROOT", str(psb_zip))
    assert len(dataset("+dataset=psb", "dataset.models=[84]").models()) == 1


def test_non_rigid_stands_for_the_categories_of_table_1(psb_zip):
    short = dataset("+dataset=psb", f"dataset.root={psb_zip}", "dataset.categories=non_rigid").models()
    long = dataset("+dataset=psb", f"dataset.root={psb_zip}", f"dataset.categories=[{','.join(NON_RIGID)}]").models()
    assert short == long
    assert len(short) == 110


def test_the_environment_says_where_tosca_is(tosca_zip, monkeypatch):
    monkeypatch.setenv("TOSCA_ROOT", str(tosca_zip))
    chosen = dataset("+dataset=tosca", "dataset.categories=[cat,michael]", "dataset.models=[michael10,cat3,dog1]")
    assert [model.name for model in chosen.models()] == ["cat3", "michael10"]


def test_a_dataset_of_files_is_named_by_its_config():
    assert dataset("+dataset=files", "dataset.name=my_cats", "dataset.glob=x").name == "my_cats"
