"""Every option that is given is used, or refused."""

import pytest

from studies.planning.errors import StudyError

OWN = """
from dataclasses import dataclass
from studies.experiments import Experiment

@dataclass(frozen=True, kw_only=True)
class Repeated(Experiment):
    repeats: int = 7
    share: float = 0.5
    def plan(self, study, dataset, segmenters):
        return []
    def tables(self, rows):
        return []

@dataclass(frozen=True, kw_only=True)
class Single(Experiment):
    share: float = 0.5
    def plan(self, study, dataset, segmenters):
        return []
    def tables(self, rows):
        return []

@dataclass(frozen=True, kw_only=True)
class Plain(Experiment):
    def plan(self, study, dataset, segmenters):
        return []
    def tables(self, rows):
        return []
"""


@pytest.fixture
def own(own_modules, monkeypatch, configured):
    """A function: class, options -> the experiment of a study of the user's own."""
    (own_modules / "own_kind.py").write_text(OWN)
    monkeypatch.chdir(own_modules)
    return lambda name, *options: (
        configured(
            "+study=custom", "study.name=mine", f"experiment._target_=own_kind.{name}", "engine=serial", *options
        ).experiment
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("+study=anatomy", "repeats=2"),
            "^repeats is not an option of the study anatomy, whose options are page, plates$",
        ),
        (("+study=versatility", "gallery.style=edges"), r"^gallery\.style is not an option of the study versatility"),
        (("+study=table1", "repeats=5", "dataset.root=x"), "table1, whose options are page, paired_with$"),
        (("+study=time", "swept=height"), "^swept is not an option of the study time, whose options are counted, "),
        (("+study=pose", "gallery.models=2", "dataset.root=x"), r"^gallery\.models is not an option of the study pose"),
        (("+study=holes", "+reapeats=2"), "^reapeats is not an option of the study holes, whose options are axis, "),
        (("+study=table2", "swept=height"), r"swept is an option of each part of this study: parts\.NAME\.swept=…$"),
        (("+study=tessellation", "+levels=[2]"), r"levels is an option of each part of this study"),
        (
            ("+study=table2", "+parts.holes.levles=[2]"),
            r"parts\.holes\.levles is not an option: a part has axis, ",
        ),
    ],
)
def test_an_option_that_the_experiment_does_not_use_is_a_mistake(words, message, plan):
    with pytest.raises(StudyError, match=message):
        plan(*words, "engine=serial")


@pytest.mark.parametrize("study", ["anatomy", "time", "versatility"])
def test_one_repeat_and_no_gallery_are_what_other_studies_do_anyway(study, configured):
    assert configured(f"+study={study}", "repeats=1", "gallery.models=0", "engine=serial").name == study


@pytest.mark.parametrize(
    "words",
    [
        ("+study=holes", "perturbation.unit=one_rings", "gallery.style=edges", "levels=[2]", "repeats=2"),
        ("+study=figure10", "swept=height", "title=Mine", "publication=null", "axis=x"),
        ("+study=table2", "parts.holes.perturbation.unit=one_rings", "+parts.holes.swept=amount"),
        ("+study=pose", "gallery.columns=3", "plates.figure6.models=[cat0]", "dataset.root=x"),
        ("+study=time", "times.count=3", "figure15.models=[cow]", "models_drawn=2"),
        ("+study=anatomy", "segmenters=[heat_walk]", "on_error=stop", "trial.timeout=null", "results_dir=x"),
    ],
)
def test_options_that_the_experiment_uses_are_accepted(words, configured):
    assert configured(*words, "engine=serial").experiment


def test_an_experiment_of_ones_own_gets_the_options_of_a_study_that_it_has_too(own):
    assert own("Repeated").repeats == 7
    assert own("Repeated", "repeats=2").repeats == 2
    assert own("Repeated", "+experiment.repeats=4", "+experiment.share=0.1").repeats == 4
    assert own("Single", "repeats=1", "gallery.models=0", "+experiment.share=0.1").share == 0.1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("Single", "repeats=2"), r"^repeats is not an option of the study mine, whose options are experiment\.share$"),
        (("Plain", "repeats=2"), "^repeats is not .* mine, which has none but those that every study has$"),
        (("Single", "levels=[1]"), "Could not override 'levels'"),
        (("Single", "+levels=[1]"), "^levels is not an option of the study mine"),
        (("Repeated", "gallery.columns=2"), r"gallery\.columns is not .* experiment\.repeats, experiment\.share$"),
    ],
)
def test_an_experiment_of_ones_own_refuses_options_that_it_does_not_have(own, words, message):
    with pytest.raises(Exception, match=message):
        own(*words)


def test_what_an_experiment_of_ones_own_is_given_is_stored(own_modules, monkeypatch, configured):
    (own_modules / "own_kind.py").write_text(OWN)
    monkeypatch.chdir(own_modules)
    target = "experiment._target_=own_kind.Repeated"
    study = configured("+study=custom", "study.name=mine", target, "engine=serial", "repeats=2")
    assert study.record["experiment"] == {"_target_": "own_kind.Repeated", "repeats": "${repeats}"}


def test_what_is_no_experiment_is_refused(configured):
    with pytest.raises(StudyError, match=r"experiment\._target_=collections\.Counter is not a subclass of studies\."):
        configured("+study=custom", "study.name=mine", "experiment._target_=collections.Counter", "engine=serial")


def test_a_study_without_trials_says_why(own_modules, monkeypatch, plan):
    (own_modules / "own_kind.py").write_text(OWN)
    (own_modules / "own_data.py").write_text(
        "from studies.datasets import Dataset\n"
        "class Nothing(Dataset):\n    name = 'nothing'\n    def models(self):\n        return []\n"
    )
    monkeypatch.chdir(own_modules)
    target = "experiment._target_=own_kind.Single"
    why = "the experiment Single plans no trials for the 1 model of the dataset bundled"
    with pytest.raises(StudyError, match=rf"^mine: there is nothing to run: {why}$"):
        plan("+study=custom", "study.name=mine", target, "dataset.models=[cow]", "engine=serial")
    with pytest.raises(StudyError, match=r"^scaling: there is nothing to run: the dataset nothing has no models$"):
        plan("+study=scaling", "dataset=custom", "dataset._target_=own_data.Nothing", "engine=serial")
