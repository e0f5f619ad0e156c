"""In which order the trials of a study are run: what several share is prepared first, once, and handed to each."""

import pickle
import time
from collections import deque
from dataclasses import dataclass
from itertools import groupby

from studies.datasets.in_memory import embed_models
from studies.execution.engine import Lost
from studies.planning import trial as trials
from studies.planning.trial import Trial


@dataclass(frozen=True, eq=False)
class Preparation:
    """The task of preparing what the trial's group shares."""

    trial: Trial

    def __call__(self):
        start = time.perf_counter()
        try:
            # Pickled here, once, and not by the head process for every trial.
            pickled = pickle.dumps(self.trial.prepare(), pickle.HIGHEST_PROTOCOL)
            return Prepared(pickled, time.perf_counter() - start)
        except Exception as error:
            return Lost("failed", trials.reason(error))

    def __str__(self):
        return f"{self.trial.model.name}"


@dataclass(frozen=True)
class Prepared:
    """What a group shares, pickled, and the seconds that it took: of one trial, its share of them."""

    pickled: bytes
    seconds: float


@dataclass(frozen=True, eq=False)
class Measurement:
    """The task of measuring one trial. Its row has ``seconds`` too, to estimate by what others will take."""

    trial: Trial
    prepared: Prepared

    def __call__(self):
        start = time.perf_counter()
        row = trials.run(self.trial, pickle.loads(self.prepared.pickled))
        return row | {"seconds": self.prepared.seconds + time.perf_counter() - start}

    def __str__(self):
        trial = self.trial
        return f"{trial.model.name} {trial.part} {trial.level:g} #{trial.repeat}"


def execute(task):
    """Run a task, wherever an engine puts it."""
    return task()


class Schedule:
    """An iterator of the tasks that can run now, and the rows that their outcomes give.

    It ends while all that is left waits for a preparation, and goes on once ``rows`` has been told of its outcome: an
    engine asks again after each. Only the preparations that trials still wait for are held.

    Parameters
    ----------
    planned : iterable of Trial, those that share a preparation one after the other
    remote : bool, whether preparations carry the content of their models, because workers may not see the files
    """

    def __init__(self, planned, remote=False):
        self._groups = (list(group) for _, group in groupby(planned, key=lambda trial: trial.shares))
        self._remote = remote
        self._waiting = {}
        self._ready = deque()  # of iterators: a model may have a hundred thousand trials

    def __iter__(self):
        return self

    def __next__(self):
        while self._ready:
            for task in self._ready[0]:
                return task
            self._ready.popleft()
        group = next(self._groups)
        task = Preparation(embed_models(group[0]) if self._remote else group[0])
        self._waiting[task] = group
        return task

    def rows(self, task, outcome):
        """The rows that ``outcome`` of ``task`` gives: none, one, or those of all trials that waited for it."""
        if isinstance(task, Measurement):
            if isinstance(outcome, Lost):
                return [trials.failed_row(task.trial, outcome.status, outcome.reason)]
            return [outcome]
        group = self._waiting.pop(task)
        if isinstance(outcome, Lost):
            return [trials.failed_row(trial, outcome.status, outcome.reason) for trial in group]
        shared = Prepared(outcome.pickled, outcome.seconds / len(group))
        self._ready.append(Measurement(trial, shared) for trial in group)
        return []
