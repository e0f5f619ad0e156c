import pytest
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from studies.datasets import Dataset, DatasetError, make_dataset
from studies.datasets.bundled import Bundled
from studies.datasets.files import Files
from studies.datasets.psb import NON_RIGID, PSB
from studies.datasets.synthetic import Synthetic
from studies.datasets.tosca import TOSCA


def dataset(*overrides):
    with initialize_config_module("conf", version_base="1.3"):
        return make_dataset(OmegaConf.to_container(compose(overrides=list(overrides)).dataset, resolve=True))


@pytest.mark.parametrize(
    ("name", "kind"),
    [("bundled", Bundled), ("files", Files), ("psb", PSB), ("synthetic", Synthetic), ("tosca", TOSCA)],
)
def test_each_config_makes_its_dataset_without_looking_for_files(name, kind, monkeypatch):
    for variable in ("PSB_ROOT", "TOSCA_ROOT"):
        monkeypatch.delenv(variable, raising=False)
    made = dataset(f"+dataset={name}")
    assert type(made) is kind
    assert made.name == name


def test_options_from_the_command_line_select_the_models(psb_zip):
    chosen = dataset(
        "+dataset=psb", f"dataset.root={psb_zip}", "dataset.categories=[Human,Ant]", "dataset.models=[84,3]"
    )
    assert [model.name for model in chosen.models()] == ["3", "84"]


def test_the_environment_locates_the_benchmark(psb_zip, monkeypatch):
    monkeypatch.setenv("PSB_ROOT", str(psb_zip))
    assert len(dataset("+dataset=psb", "dataset.models=[84]").models()) == 1


def test_non_rigid_means_the_categories_of_table_1(psb_zip):
    short = dataset("+dataset=psb", f"dataset.root={psb_zip}", "dataset.categories=non_rigid").models()
    long = dataset("+dataset=psb", f"dataset.root={psb_zip}", f"dataset.categories=[{','.join(NON_RIGID)}]").models()
    assert short == long
    assert len(short) == 110


def test_the_environment_locates_tosca(tosca_zip, monkeypatch):
    monkeypatch.setenv("TOSCA_ROOT", str(tosca_zip))
    chosen = dataset("+dataset=tosca", "dataset.categories=[cat,michael]", "dataset.models=[michael10,cat3,dog1]")
    assert [model.name for model in chosen.models()] == ["cat3", "michael10"]


def test_a_dataset_of_files_is_named_by_its_config():
    assert dataset("+dataset=files", "dataset.name=my_cats", "dataset.glob=x").name == "my_cats"


MINE = """
from dataclasses import dataclass
import hashlib

import numpy as np

from heatwalk import LoadedMesh
from studies.datasets import Dataset, Model


@dataclass(frozen=True)
class Prism(Model):
    height: float

    def load(self):
        vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, self.height]], dtype=float)
        return LoadedMesh(vertices, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]), ())

    def digest(self):
        return hashlib.sha256(repr(self).encode()).hexdigest()


class Prisms(Dataset):
    name = "prisms"

    def __init__(self, heights=(1, 2)):
        if min(heights) <= 0:
            raise ValueError(f"dataset.heights={heights} must be positive")
        self.heights = heights

    def models(self):
        return [Prism(f"prism{height}", "prism", float(height)) for height in self.heights]


class Nameless(Prisms):
    name = ""


class Abstract(Dataset):
    name = "abstract"


def prisms():
    return Prisms()
"""


@pytest.fixture
def mine(own_modules, monkeypatch):
    """The current folder, with a module my_shapes of the user's own, which is nowhere else on the path."""
    (own_modules / "my_shapes.py").write_text(MINE)
    monkeypatch.chdir(own_modules)


def test_a_class_in_the_current_folder_is_a_dataset(mine):
    own = dataset("+dataset=custom", "dataset._target_=my_shapes.Prisms", "+dataset.heights=[3,5]")
    assert isinstance(own, Dataset)
    assert [model.name for model in own.models()] == ["prism3", "prism5"]
    assert own.models()[1].load().vertices.max() == 5


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ([], r"^dataset._target_ is required: dataset._target_=my_package.MyDataset$"),
        (["dataset._target_=no_such.Shapes"], "^dataset._target_=no_such.Shapes: .*No module named 'no_such'"),
        (["dataset._target_=my_shapes.Cones"], "no attribute 'Cones'"),
        (["dataset._target_=my_shapes.np"], "is a module and cannot be called"),
        (["dataset._target_=my_shapes.prisms"], "is not a subclass of studies.datasets.Dataset"),
        (["dataset._target_=my_shapes.Prism"], "is not a subclass of studies.datasets.Dataset"),
        (["dataset._target_=my_shapes.Abstract"], "abstract"),
        (["dataset._target_=my_shapes.Nameless"], "has no name: set the class attribute `name`"),
        (["dataset._target_=my_shapes.Prisms", "+dataset.k=1"], r"'k'; .* given as \+dataset.NAME=VALUE$"),
        (["dataset._target_=my_shapes.Prisms", "+dataset.heights=[-1]"], r"^dataset.heights=\[-1\] must be positive$"),
    ],
)  # fmt: skip
def test_options_that_describe_no_dataset_are_refused(overrides, message, mine):
    with pytest.raises(DatasetError, match=message):
        dataset("+dataset=custom", *overrides)


def test_options_of_the_default_dataset_are_not_those_of_ones_own(mine):
    with pytest.raises(DatasetError, match=r"'root'; .* the options of dataset=custom"):
        dataset("+dataset=tosca", "dataset._target_=my_shapes.Prisms")


@pytest.mark.parametrize("group", ["custom", "bundled"])
def test_models_of_a_dataset_of_ones_own_can_be_selected(mine, group):
    own = ("+dataset=" + group, "dataset._target_=my_shapes.Prisms", "+dataset.heights=[3,5,8]")
    assert [model.name for model in dataset(*own).models()] == ["prism3", "prism5", "prism8"]
    some = dataset(*own, "dataset.models=[prism8,prism3]")
    assert [model.name for model in some.models()] == ["prism3", "prism8"]
    assert some.name == dataset(*own).name
    with pytest.raises(DatasetError, match=r"the dataset \w+ does not have the models cube; it has prism3, prism5"):
        dataset(*own, "dataset.models=[prism3,cube]").models()
    with pytest.raises(DatasetError, match=r"dataset\.models=prism3 must be a list"):
        dataset(*own, "dataset.models=prism3")


def test_a_dataset_of_ones_own_that_has_an_option_models_selects_them_itself(mine, own_modules):
    (own_modules / "my_solids.py").write_text(
        "from my_shapes import Prisms\n"
        "class Solids(Prisms):\n"
        "    def __init__(self, models=('tall',)):\n"
        "        super().__init__([{'tall': 9, 'flat': 1}[name] for name in models])\n"
    )
    own = ("+dataset=custom", "dataset._target_=my_solids.Solids")
    assert [model.name for model in dataset(*own).models()] == ["prism9"]
    assert [model.name for model in dataset(*own, "dataset.models=[flat]").models()] == ["prism1"]
