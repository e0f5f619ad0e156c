"""How far a study is: before it runs, and while it does."""

from datetime import timedelta

from rich import progress
from rich.table import Table
from rich.text import Text


class Progress(progress.Progress):
    """Trials done and failed, how many a second, the time left and what each worker is on. A file sees nothing of it.

    Parameters
    ----------
    total : int, how many trials there are to do
    engine : see `studies.execution.engine`
    console : rich.console.Console
    """

    def __init__(self, total, engine, console):
        self._engine = engine
        self._failed = 0
        super().__init__(
            progress.TextColumn("trials"),
            progress.BarColumn(bar_width=None),
            progress.MofNCompleteColumn(),
            progress.TextColumn("{task.fields[rate]}"),
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
        self._bar = self.add_task("trials", total=total, rate="", failures="")

    def count(self, status):
        """One more trial is done."""
        self._failed += status != "ok"
        speed = self.tasks[0].finished_speed or self.tasks[0].speed
        self.update(
            self._bar,
            advance=1,
            rate=f"{speed:.1f}/s" if speed else "",
            failures=f"{self._failed} failed" if self._failed else "",
        )

    def get_renderables(self):
        yield from super().get_renderables()
        for task in self._engine.active():
            yield Text(f"  on {task}", style="dim", no_wrap=True, overflow="ellipsis")


def show_plan(trials, missing, stored, elsewhere, engine, console):
    """Print what a run would do.

    Parameters
    ----------
    trials, missing : lists of Trial, all and those that are not stored
    stored : studies.storage.store.Rows; None where nothing stored would count
    elsewhere : as `studies.storage.store.elsewhere` gives it, of the missing
    engine : see `studies.execution.engine`
    console : rich.console.Console
    """
    absent = {trial.trial_id for trial in missing}
    status = stored.status if stored else {}
    table = Table("part", *COUNTED, title="Planned", title_justify="left")
    for column in table.columns[1:]:
        column.justify = "right"
    parts = {}
    for trial in trials:
        parts.setdefault(trial.part, []).append(trial)
    for part, group in parts.items():
        states = [status.get(trial.trial_id) for trial in group]
        numbers = (
            len({trial.model.name for trial in group}),
            len({trial.level for trial in group}),
            len({trial.repeat for trial in group}),
            len(group),
            sum(state is not None for state in states),
            sum(state not in (None, "ok") for state in states),
            sum(trial.trial_id in absent for trial in group),
        )
        table.add_row(part, *(f"{number:,}" for number in numbers))
    console.print(table)
    for path, trial_ids in elsewhere.items():
        console.print(f"{len(trial_ids):,} would be taken over from {path}", highlight=False, soft_wrap=True)
    to_run = len(missing) - sum(map(len, elsewhere.values()))
    console.print(f"{to_run:,} to run; {_time_left(to_run, stored, engine)}", highlight=False, soft_wrap=True)
    console.print("nothing was run or written (dry_run=true)")


COUNTED = ("models", "levels", "repeats", "trials", "stored", "failed", "missing")


def _time_left(to_run, stored, engine):
    if not to_run:
        return "no time left"
    if not stored or stored.seconds is None:
        return "time left: unknown, none of this study is stored that says what a trial takes"
    work = to_run * stored.seconds
    shared = f", {_duration(work / engine.processes)} with {engine.processes} at once" if engine.processes else ""
    return f"time left, from the trials that are stored: {_duration(work)} of work{shared}"


def _duration(seconds):
    return str(timedelta(seconds=round(seconds))) if seconds >= 1 else "under a second"
