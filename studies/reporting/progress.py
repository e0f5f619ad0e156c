"""How far a study is: before it runs, and while it runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from rich import progress
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from studies.execution import Engine
    from studies.planning.trial import Trial
    from studies.storage import StoredRows

# Seconds between two lines of progress where there is no terminal: at least, and at most if trials do not take longer.
LINE_SECONDS = 5.0
SILENT_SECONDS = 30.0

COUNTS = ("models", "levels", "repeats", "trials", "stored", "failed", "missing")


class _Speed(progress.ProgressColumn):
    """Trials per second, computed when it is shown: it is a sum over the last thousand trials."""

    def render(self, task: progress.Task) -> Text:
        """The number, or nothing if it is not known yet."""
        speed = task.finished_speed or task.speed
        return Text(f"{speed:.1f}/s" if speed else "")


class Progress(progress.Progress):
    """Trials done and failed, trials per second, time left, and what each worker is doing.

    If the console is not a terminal, it prints a line now and then instead: at each tenth of the trials, but not within
    `LINE_SECONDS` of the last line, and when a trial ends `SILENT_SECONDS` after the last line.

    Parameters
    ----------
    total : int
        number of trials to run
    engine : Engine
    console : rich.console.Console
    clock : callable
        () -> seconds
    """

    def __init__(
        self, total: int, engine: Engine, console: Console, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._engine = engine
        self._failed = 0
        self._done = 0
        self._total = total
        self._clock = clock
        self._start = self._last_line = clock()
        self._tenth = 1  # the next of which a line tells
        super().__init__(
            progress.TextColumn("trials"),
            progress.BarColumn(bar_width=None),
            progress.MofNCompleteColumn(),
            _Speed(),
            progress.TimeElapsedColumn(),
            progress.TextColumn("left"),
            progress.TimeRemainingColumn(),
            progress.TextColumn("[red]{task.fields[failures]}"),
            console=console,
            disable=not console.is_terminal,
            refresh_per_second=2,
            speed_estimate_period=120,
            expand=True,
        )
        self._bar = self.add_task("trials", total=total, failures="")

    def count(self, status: str) -> None:
        """Count one more trial as done."""
        self._failed += status != "ok"
        self._done += 1
        if not self.console.is_terminal:
            self._print_line()
        self.update(self._bar, advance=1, failures=f"{self._failed} failed" if self._failed else "")

    def _print_line(self) -> None:
        """Print how far the study is, if it is time to."""
        now = self._clock()
        silence = now - self._last_line
        is_tenth = 10 * self._done >= self._tenth * self._total and silence >= LINE_SECONDS
        if self._done == self._total or not (is_tenth or silence >= SILENT_SECONDS):
            return
        self._last_line, self._tenth = now, 10 * self._done // self._total + 1
        left = (now - self._start) / self._done * (self._total - self._done)
        failed = f", {self._failed:,} failed" if self._failed else ""
        self.console.print(
            f"  {self._done:,} of {self._total:,} trials{failed}; {_duration(left)} left",
            highlight=False,
            soft_wrap=True,
        )

    def get_renderables(self) -> Iterable[RenderableType]:
        """The bar, and a line per task that is being worked on."""
        yield from super().get_renderables()
        for task in self._engine.active():
            yield Text(f"  on {task}", style="dim", no_wrap=True, overflow="ellipsis")


def show_plan(
    trials: Sequence[Trial],
    missing: Sequence[Trial],
    stored: StoredRows | None,
    reusable: Mapping[Path, Sized],
    engine: Engine,
    console: Console,
) -> None:
    """Print what a run would do.

    Parameters
    ----------
    trials, missing : sequence of Trial
        all, and those that are not stored
    stored : StoredRows or None
        None if nothing stored would count
    reusable : mapping
        of the missing ones, as `studies.storage.find_reusable` returns it
    engine : Engine
    console : rich.console.Console
    """
    console.print(_counts_by_part(trials, missing, stored))
    for path, trial_ids in reusable.items():
        console.print(f"{len(trial_ids):,} would be reused from {path}", highlight=False, soft_wrap=True)
    to_run = len(missing) - sum(map(len, reusable.values()))
    console.print(f"{to_run:,} to run; {_time_left(to_run, stored, engine)}", highlight=False, soft_wrap=True)
    console.print("nothing was run or written (dry_run=true)")


def _counts_by_part(trials: Sequence[Trial], missing: Sequence[Trial], stored: StoredRows | None) -> Table:
    """How many trials of each part are planned, stored and missing. No number is ever cut."""
    table = Table(title="Planned", title_justify="left")
    table.add_column("part", overflow="fold")
    for name in COUNTS:
        table.add_column(name, justify="right", no_wrap=True, min_width=len(name))
    parts: dict[str, _PartCounts] = {}
    to_run = iter(missing)  # some of the trials, in the same order
    following = next(to_run, None)
    for trial in trials:
        counts = parts.setdefault(trial.part, _PartCounts())
        is_missing = following is not None and trial.trial_id == following.trial_id
        counts.add(trial, stored.status.get(trial.trial_id) if stored else None, is_missing)
        if is_missing:
            following = next(to_run, None)
    for part, counts in parts.items():
        table.add_row(part, *(f"{count:,}" for count in counts.numbers()))
    return table


@dataclass
class _PartCounts:
    """How many trials of a part there are."""

    models: set[str] = field(default_factory=set)
    levels: set[float] = field(default_factory=set)
    repeats: set[int] = field(default_factory=set)
    trials: int = 0
    stored: int = 0
    failed: int = 0
    missing: int = 0

    def add(self, trial: Trial, status: str | None, is_missing: bool) -> None:
        """Count a trial."""
        self.models.add(trial.model.name)
        self.levels.add(trial.level)
        self.repeats.add(trial.repeat)
        self.trials += 1
        self.stored += status is not None
        self.failed += status not in (None, "ok")
        self.missing += is_missing

    def numbers(self) -> tuple[int, ...]:
        """The counts in the order of `COUNTS`."""
        distinct = len(self.models), len(self.levels), len(self.repeats)
        return (*distinct, self.trials, self.stored, self.failed, self.missing)


def _time_left(to_run: int, stored: StoredRows | None, engine: Engine) -> str:
    if not to_run:
        return "no time left"
    if not stored or stored.seconds is None:
        return (
            "time left: unknown until some of them have run; start the study, stop it by Ctrl-C after a few trials, "
            "and dry_run=true estimates the rest from their time"
        )
    work = to_run * stored.seconds
    shared = f", {_duration(work / engine.processes)} with {engine.processes} at once" if engine.processes else ""
    return f"time left, estimated from the stored trials: {_duration(work)} of work{shared}"


def _duration(seconds: float) -> str:
    return str(timedelta(seconds=round(seconds))) if seconds >= 1 else "under a second"
