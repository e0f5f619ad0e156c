"""In which order trials run: what the trials of a group share is prepared once, and handed to each of them."""

import pickle
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from studies.datasets.in_memory import embed_models
from studies.execution.engine import Engine, TaskFailure
from studies.execution.interruption import is_ctrl_c, reason, traceback_of
from studies.planning.plan import Plan
from studies.planning.trial import Trial, failed_row, run_trial

Row = dict[str, Any]


@dataclass(frozen=True)
class Prepared:
    """What the trials of a group share.

    Parameters
    ----------
    pickled : bytes
        the result of `Trial.prepare`, pickled once
    seconds : float
        share of each trial in the time that preparing it took
    """

    pickled: bytes
    seconds: float


@dataclass(frozen=True, eq=False)
class Preparation:
    """The task of preparing what the group of ``trial`` shares."""

    trial: Trial

    def __call__(self) -> Prepared | TaskFailure:
        start = time.perf_counter()
        try:
            # Pickled here, once, and not by the head process for every trial.
            pickled = pickle.dumps(self.trial.prepare(), pickle.HIGHEST_PROTOCOL)
        except BaseException as error:
            if is_ctrl_c(error):
                raise
            return TaskFailure("failed", reason(error), traceback_of(error))
        return Prepared(pickled, time.perf_counter() - start)

    def __str__(self) -> str:
        return self.trial.model.name


@dataclass(frozen=True, eq=False)
class Measurement:
    """The task of running one trial. Its row has ``seconds`` too, from which the time of other trials is estimated."""

    trial: Trial
    prepared: Prepared

    def __call__(self) -> Row:
        start = time.perf_counter()
        row = run_trial(self.trial, pickle.loads(self.prepared.pickled))
        return row | {"seconds": self.prepared.seconds + time.perf_counter() - start}

    def __str__(self) -> str:
        trial = self.trial
        return f"{trial.model.name} {trial.part} {trial.level:g} #{trial.repeat}"


Task = Preparation | Measurement


def run_task(task: Task) -> Any:
    """Execute a task of a `Schedule`, in whatever process an engine chooses."""
    return task()


class Schedule:
    """The tasks of a study, each as soon as it can run, and the rows that their outcomes make.

    Trials are consumed group by group. Only the preparations that trials still wait for are held.

    Parameters
    ----------
    trials : iterable of Trial
        those with the same ``group_key`` one after the other
    remote : bool
        whether tasks must contain the content of their models, because workers may not see the files
    """

    def __init__(self, trials: Iterable[Trial], remote: bool = False) -> None:
        self._groups = trials.groups() if isinstance(trials, Plan) else _listed_groups(trials)
        self._remote = remote
        self._waiting: dict[Task, Sequence[Trial]] = {}
        self._ready: deque[Iterator[Measurement]] = deque()  # per group; lazy, a group may have 100,000 trials

    def next_task(self) -> Task | None:
        """A task that can run now.

        Returns
        -------
        Preparation or Measurement or None
            None if all tasks that are left wait for the outcome of others, and if none is left
        """
        while self._ready:
            measurement = next(self._ready[0], None)
            if measurement is not None:
                return measurement
            self._ready.popleft()
        group = next(self._groups, None)
        if group is None:
            return None
        preparation = Preparation(embed_models(group[0]) if self._remote else group[0])
        self._waiting[preparation] = group
        return preparation

    def complete(self, task: Task, outcome: Any) -> list[Row]:
        """Take the outcome of a task.

        Parameters
        ----------
        task : Preparation or Measurement
            from `next_task`
        outcome : Any
            what `run_task` returned, or a `TaskFailure`

        Returns
        -------
        list of dict
            the rows that it makes: none, one, or those of all trials that waited for it
        """
        if isinstance(task, Measurement):
            if isinstance(outcome, TaskFailure):
                return [failed_row(task.trial, outcome.status, outcome.reason, outcome.traceback)]
            return [outcome]
        group = self._waiting.pop(task)
        if isinstance(outcome, TaskFailure):
            return [failed_row(trial, outcome.status, outcome.reason, outcome.traceback) for trial in group]
        prepared = Prepared(outcome.pickled, outcome.seconds / len(group))
        self._ready.append(Measurement(trial, prepared) for trial in group)
        return []


def _listed_groups(trials: Iterable[Trial]) -> Iterator[Sequence[Trial]]:
    return (list(group) for _, group in groupby(trials, key=lambda trial: trial.group_key))


def run_trials(engine: Engine, trials: Iterable[Trial]) -> Generator[Row, None, None]:
    """Run trials on an engine; see `run_batches`.

    Yields
    ------
    dict
        a row per trial, as soon as it is made
    """
    with closing(run_batches(engine, trials)) as batches:
        for rows in batches:
            yield from rows


def run_batches(
    engine: Engine, trials: Iterable[Trial], meanwhile: Callable[[], None] | None = None
) -> Generator[list[Row], None, None]:
    """Run trials on an engine.

    Parameters
    ----------
    engine : Engine
    trials : iterable of Trial
        those with the same ``group_key`` one after the other; consumed as needed
    meanwhile : callable, optional
        () -> None, called once, when the first tasks have been handed over

    Yields
    ------
    list of dict
        a row for each trial that has finished, as soon as there are any. Values may be numpy arrays; see
        `Trial.measure`. Closing the iterator stops the engine.
    """
    schedule = Schedule(trials, engine.remote)
    with engine.open(run_task) as session:
        while True:
            while session.has_room() and (task := schedule.next_task()) is not None:
                session.submit(task)
            if not session.pending:
                return
            if meanwhile is not None:
                meanwhile()
                meanwhile = None
            rows = [row for task, outcome in session.wait() for row in schedule.complete(task, outcome)]
            if rows:
                yield rows
