import pickle
from dataclasses import dataclass, replace

import numpy as np
import pytest

from studies.datasets import DatasetError, Model
from studies.datasets.files import Files
from studies.datasets.in_memory import EmbeddedModel, InMemoryModel, embed_models
from studies.datasets.psb import PSB
from studies.datasets.tosca import TOSCA
from tests.helpers.meshes import bundled


@dataclass(frozen=True)
class Pair:
    """As a trial: models in several of its fields."""

    model: Model
    others: tuple[Model, ...] = ()
    mixed: tuple = (1, "a")
    name: str = ""


def sent(trial):
    return pickle.loads(pickle.dumps(embed_models(trial)))


def test_a_model_that_is_sent_takes_its_mesh_along(tmp_path):
    bundled("ant").export(tmp_path / "ant.off")
    [model] = Files(str(tmp_path)).models()
    arrived = sent(Pair(model)).model
    mesh = model.load()
    (tmp_path / "ant.off").unlink()
    assert type(arrived) is InMemoryModel
    assert (arrived.name, arrived.category) == (model.name, model.category)
    assert np.array_equal(arrived.load().vertices, mesh.vertices)
    assert np.array_equal(arrived.load().faces, mesh.faces)
    assert arrived.human_segmentations() == []


def test_a_model_that_is_sent_takes_the_segmentations_by_people_along(psb_zip):
    [model] = PSB(psb_zip, models=[81]).models()
    arrived = sent(Pair(model)).model
    for ours, theirs in zip(model.human_segmentations(), arrived.human_segmentations(), strict=True):
        assert np.array_equal(ours, theirs)


def test_models_in_tuples_are_sent_once_each_with_their_correspondence(tosca_zip):
    a, b = TOSCA(tosca_zip, models=["cat0", "cat1"]).models()
    arrived = sent(Pair(a, (a, b), mixed=(b, 5), name="pair"))
    assert arrived.model is arrived.others[0]
    assert arrived.others[1] is arrived.mixed[0]
    assert arrived.mixed[1] == 5
    assert arrived.name == "pair"
    assert np.array_equal(arrived.mixed[0].correspondence(), b.correspondence())


def test_what_a_model_raises_is_raised_where_it_arrives_and_not_before(tmp_path):
    (tmp_path / "a.off").write_text("OFF\nnothing\n")
    [model] = Files(str(tmp_path)).models()
    arrived = sent(Pair(model)).model
    with pytest.raises(ValueError, match=r"a\.off"):
        arrived.load()
    with pytest.raises(DatasetError, match="does not specify corresponding points"):
        arrived.correspondence()


def test_a_model_that_arrived_has_no_digest(tmp_path):
    bundled("ant").export(tmp_path / "ant.off")
    [model] = Files(str(tmp_path)).models()
    with pytest.raises(NotImplementedError, match="model ant has no digest here"):
        sent(Pair(model)).model.digest()


def test_before_it_is_sent_an_embedded_model_returns_what_the_model_returns(psb_zip, tosca_zip):
    for [model] in (PSB(psb_zip, models=[81]).models(), TOSCA(tosca_zip, models=["cat0"]).models()):
        embedded = embed_models(Pair(model)).model
        assert type(embedded) is EmbeddedModel
        assert embedded.digest() == model.digest()
        assert embedded.human_digest() == model.human_digest()
        assert embedded.correspondence_digest() == model.correspondence_digest()
        assert len(embedded.human_segmentations()) == len(model.human_segmentations())
        assert np.array_equal(embedded.load().faces, model.load().faces)


def test_a_trial_without_models_stays_as_it_is():
    pair = Pair(InMemoryModel("a", "", {}))
    assert embed_models(replace(pair, model=None)) == replace(pair, model=None)
