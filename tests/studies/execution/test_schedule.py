from dataclasses import dataclass

import pytest

from studies.datasets import Model
from studies.execution.engine import Local, Lost, Serial
from studies.execution.schedule import Measurement, Preparation, Prepared, Schedule, execute
from studies.planning.trial import Trial


class Square(Model):
    def load(self):
        raise NotImplementedError

    def digest(self):
        return self.name


@dataclass(frozen=True, kw_only=True)
class Counted(Trial):
    """Prepares a number that tells how often it was prepared in this process, and fails where its model says so."""

    def prepare(self):
        if self.model.name == "unreadable":
            raise OSError("no such file")
        prepared.append(self.model.name)
        return prepared.count(self.model.name)

    def measure(self, number):
        if self.level == 13:
            raise RuntimeError("bad luck")
        return {"n_segments": number}


prepared = []


def trials(*models, levels=(1, 2, 3)):
    return [
        Counted(
            study="s", dataset="d", part="s", model=Square(model, ""), mesh="", segmenter_name="x", level=level,
            shares=model, trial_id=f"{model}{level}",
        )
        for model in models
        for level in levels
    ]  # fmt: skip


def rows_of(planned, engine):
    schedule = Schedule(planned)
    return [row for task, outcome in engine.run(execute, schedule) for row in schedule.rows(task, outcome)]


@pytest.mark.parametrize("engine", [Serial(), Local(workers=1), Local(workers=3)])
def test_every_trial_gives_one_row_and_each_model_is_prepared_once(engine):
    prepared.clear()
    planned = trials("a", "b", "c", "d", "e")
    rows = rows_of(planned, engine)
    assert sorted(row["trial_id"] for row in rows) == sorted(trial.trial_id for trial in planned)
    assert {row["status"] for row in rows} == {"ok"}
    assert {row["n_segments"] for row in rows} == {1}


def test_a_model_that_cannot_be_prepared_costs_its_own_trials_and_is_tried_once():
    rows = rows_of(trials("a", "unreadable", "b"), Serial())
    failed = [row for row in rows if row["status"] != "ok"]
    assert {row["model"] for row in failed} == {"unreadable"}
    assert [row["error"] for row in failed] == ["OSError: no such file"] * 3


def test_a_trial_that_fails_costs_itself():
    rows = rows_of(trials("a", levels=(1, 13, 2)), Serial())
    assert [(row["level"], row["status"]) for row in rows] == [(1, "ok"), (13, "failed"), (2, "ok")]


def test_a_preparation_that_takes_the_process_down_is_the_reason_of_all_its_trials():
    schedule = Schedule(trials("a"))
    task = next(schedule)
    assert isinstance(task, Preparation)
    with pytest.raises(StopIteration):
        next(schedule)
    rows = schedule.rows(task, Lost("crashed", "its process died"))
    assert [(row["status"], row["error"]) for row in rows] == [("crashed", "its process died")] * 3


def test_what_waits_is_given_once_its_preparation_is_there():
    schedule = Schedule(trials("a", "b"))
    first, second = next(schedule), next(schedule)
    with pytest.raises(StopIteration):
        next(schedule)
    assert schedule.rows(second, execute(second)) == []
    waiting = [task.trial.model.name for task in schedule]
    assert waiting == ["b"] * 3
    schedule.rows(first, execute(first))
    assert all(isinstance(task, Measurement) and task.trial.model.name == "a" for task in schedule)


def test_rows_tell_their_share_of_what_they_share_and_the_seconds_of_all_are_those_of_the_work():
    rows = rows_of(trials("a", levels=(1, 2, 3, 4)), Slow())
    assert [row["seconds"] for row in rows] == [pytest.approx(0.2 / 4, abs=0.04)] * 4


class Slow(Serial):
    """As an engine would find it that takes 0.2 seconds for each preparation."""

    def run(self, function, tasks):
        for task, outcome in super().run(function, tasks):
            yield task, Prepared(outcome.pickled, 0.2) if isinstance(outcome, Prepared) else outcome


def test_tasks_say_what_they_are():
    schedule = Schedule(trials("a", levels=(1,)))
    task = next(schedule)
    assert str(task) == "a"
    schedule.rows(task, execute(task))
    assert str(next(schedule)) == "a s 1 #0"
