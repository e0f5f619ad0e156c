import weakref
from dataclasses import dataclass

import pytest

from studies.datasets import Model
from studies.execution import Local, Schedule, Serial, TaskFailure, run_trials
from studies.execution.schedule import Measurement, Preparation, Prepared, run_task
from studies.planning.trial import Trial


class Square(Model):
    def load(self):
        raise NotImplementedError

    def digest(self):
        return self.name


@dataclass(frozen=True, kw_only=True)
class Counted(Trial):
    """Prepares a number of times that it was prepared in this process; fails if its model has a certain name."""

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
            study="s", dataset="d", part="s", model=Square(model, ""), mesh_digest="", segmenter_name="x", level=level,
            group_key=model, trial_id=f"{model}{level}",
        )
        for model in models
        for level in levels
    ]  # fmt: skip


@pytest.mark.parametrize("engine", [Serial(), Local(workers=1), Local(workers=3)])
def test_every_trial_makes_one_row_and_each_group_is_prepared_once(engine):
    prepared.clear()
    planned = trials("a", "b", "c", "d", "e")
    rows = list(run_trials(engine, planned))
    assert sorted(row["trial_id"] for row in rows) == sorted(trial.trial_id for trial in planned)
    assert {row["status"] for row in rows} == {"ok"}
    assert {row["n_segments"] for row in rows} == {1}


def test_a_preparation_that_fails_costs_its_own_trials_and_is_tried_once():
    rows = list(run_trials(Serial(), trials("a", "unreadable", "b")))
    failed = [row for row in rows if row["status"] != "ok"]
    assert {row["model"] for row in failed} == {"unreadable"}
    assert [row["error"] for row in failed] == ["OSError: no such file"] * 3


def test_a_trial_that_fails_costs_itself():
    rows = run_trials(Serial(), trials("a", levels=(1, 13, 2)))
    assert [(row["level"], row["status"]) for row in rows] == [(1, "ok"), (13, "failed"), (2, "ok")]


def test_a_preparation_that_kills_its_process_is_the_reason_of_all_its_trials():
    schedule = Schedule(trials("a"))
    task = schedule.next_task()
    assert isinstance(task, Preparation)
    assert schedule.next_task() is None
    rows = schedule.complete(task, TaskFailure("crashed", "its process died"))
    assert [(row["status"], row["error"]) for row in rows] == [("crashed", "its process died")] * 3
    assert schedule.next_task() is None


def test_trials_can_run_once_their_preparation_is_complete():
    schedule = Schedule(trials("a", "b"))
    first, second = schedule.next_task(), schedule.next_task()
    assert schedule.next_task() is None
    assert schedule.complete(second, run_task(second)) == []
    waiting = list(iter(schedule.next_task, None))
    assert [task.trial.model.name for task in waiting] == ["b"] * 3
    schedule.complete(first, run_task(first))
    waiting = list(iter(schedule.next_task, None))
    assert all(isinstance(task, Measurement) and task.trial.model.name == "a" for task in waiting)
    assert len(waiting) == 3


def test_trials_are_consumed_group_by_group():
    consumed = []

    def lazily():
        for trial in trials(*(f"model {i}" for i in range(1000))):
            consumed.append(trial.trial_id)
            yield trial

    rows = run_trials(Serial(), lazily())
    assert next(rows)["model"] == "model 0"
    assert len(consumed) <= 7  # two groups, and the trial at which the second is seen to end
    rows.close()


def test_only_preparations_that_trials_wait_for_are_held():
    schedule = Schedule(trials("a", "b"))
    held = []
    for _ in range(2):
        preparation = schedule.next_task()
        prepared_by_task = run_task(preparation)
        held.append(weakref.ref(prepared_by_task))
        schedule.complete(preparation, prepared_by_task)
        del prepared_by_task
        measurements = [schedule.next_task() for _ in range(3)]
        held.append(weakref.ref(measurements[0].prepared))
        assert measurements[0].prepared is measurements[2].prepared
        del measurements
    assert schedule.next_task() is None
    assert [reference() for reference in held] == [None] * 4


def test_rows_have_their_share_of_the_seconds_that_preparing_took():
    schedule = Schedule(trials("a", levels=(1, 2, 3, 4)))
    preparation = schedule.next_task()
    schedule.complete(preparation, Prepared(run_task(preparation).pickled, 200.0))
    rows = [run_task(task) for task in iter(schedule.next_task, None)]
    assert [row["seconds"] for row in rows] == [pytest.approx(50, abs=5)] * 4


def test_closing_the_rows_stops_the_engine():
    engine = Local(workers=1)
    rows = run_trials(engine, trials("a", "b"))
    next(rows)
    rows.close()
    assert engine.active() == []


def test_tasks_are_shown_by_what_they_work_on():
    schedule = Schedule(trials("a", levels=(1,)))
    task = schedule.next_task()
    assert str(task) == "a"
    schedule.complete(task, run_task(task))
    assert str(schedule.next_task()) == "a s 1 #0"
