"""Which models and poses the plates show if the study does not have those of the configuration."""

from types import SimpleNamespace

import pytest

from studies.experiments.anatomy import EACH_CATEGORY, Anatomy, _shown_models
from studies.experiments.poses import _of_each_shape


def trials(**categories):
    """Trials of models "Ant0", "Ant1" … by name."""
    return {
        f"{category}{i}": SimpleNamespace(
            trial_id=f"{category}{i}", model=SimpleNamespace(name=f"{category}{i}", category=category), part=category
        )
        for category, count in categories.items()
        for i in range(count)
    }


@pytest.mark.parametrize(
    ("shows", "wanted", "shown"),
    [
        ("showcase", ["Ant1", "Cup0", "x"], ["Ant1", "Cup0"]),
        ("showcase", ["x"], ["Ant0", "Cup0", "Hand0"]),
        ("showcase", ["Cup1"], ["Ant0", "Cup0", "Hand0"]),
        ("class", ["x"], ["Cup0", "Cup1", "Cup2"]),
        ("class", ["Ant0", "Ant1"], ["Ant0", "Ant1"]),
        ("walk", ["Cup1", "Cup2"], ["Cup1", "Cup2"]),
        ("walk", ["x"], ["Ant0"]),
        ("walk", EACH_CATEGORY, ["Ant0", "Cup0", "Hand0"]),
    ],
)
def test_a_plate_shows_the_models_that_it_names_or_some_that_suit_it(shows, wanted, shown):
    assert _shown_models(shows, wanted, trials(Ant=2, Cup=3, Hand=1)) == shown


def test_a_showcase_of_one_category_shows_many_of_its_models_and_one_of_no_trial_none():
    assert len(_shown_models("showcase", ["x"], trials(Ant=50))) == 20
    assert len(_shown_models("class", ["x"], trials(Ant=50))) == 10
    assert _shown_models("showcase", ["x"], {}) == []


def plates(by_name, wanted):
    import pandas as pd

    experiment = Anatomy(
        plates={"five": {"shows": "showcase", "models": ["x"]}, "seven": {"shows": "class", "models": wanted}}
    )
    rows = pd.DataFrame({"trial_id": list(by_name), "status": "ok"})
    pictures = experiment.pictures("versatility", list(by_name.values()), rows, "Versatility", lambda _: None)
    return [picture.stem for picture in pictures]


def test_no_picture_is_drawn_twice_unless_its_models_were_asked_for():
    assert plates(trials(animal=3), ["y"]) == ["five"]
    assert plates(trials(animal=3), ["animal0", "animal1", "animal2"]) == ["five", "seven"]
    assert plates(trials(Ant=1, Cup=2), ["y"]) == ["five", "seven"]
    assert plates(trials(animal=1), ["y"]) == ["five"]


def test_poses_are_taken_from_every_shape_in_turn_and_shown_shape_by_shape():
    poses = trials(cat=5, dog=1, michael=4)
    assert _of_each_shape(poses, 6) == ["cat0", "cat1", "cat2", "dog0", "michael0", "michael1"]
    assert _of_each_shape(poses, 1) == ["cat0"]
    assert _of_each_shape({}, 6) == []
