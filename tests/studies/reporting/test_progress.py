import io

import rich.progress
from rich.console import Console

from studies.reporting.progress import Progress, _Speed


class Busy:
    """An engine with two workers, one of which has something to do."""

    def active(self):
        return ["ant normal_noise 0.1 #3"]


def shown(**options):
    written = io.StringIO()
    with Progress(5, Busy(), Console(file=written, width=100, **options)) as progress:
        for status in ("ok", "failed", "ok"):
            progress.count(status)
        progress.refresh()
    return written.getvalue()


def test_it_tells_what_is_done_what_failed_what_is_left_and_what_is_worked_on():
    out = shown(force_terminal=True, color_system=None)
    for words in ("3/5", "1 failed", "left", "on ant normal_noise 0.1 #3"):
        assert words in out


def lines_of(total, seconds_per_trial, failing=()):
    """The lines that a file gets of a study whose trials take so long, by a clock that stands still otherwise."""
    written, now = io.StringIO(), [0.0]
    with Progress(total, Busy(), Console(file=written, width=60), clock=lambda: now[0]) as progress:
        for trial in range(total):
            now[0] += seconds_per_trial
            progress.count("failed" if trial in failing else "ok")
    return [line.strip() for line in written.getvalue().splitlines()]


def test_a_file_gets_a_line_at_each_tenth_of_the_trials():
    lines = lines_of(200, 1.0)
    assert [line.split()[0] for line in lines] == ["20", "40", "60", "80", "100", "120", "140", "160", "180"]
    assert lines[0] == "20 of 200 trials; 0:03:00 left"


def test_a_file_gets_a_line_after_half_a_minute_without_one():
    assert [line.split()[0] for line in lines_of(2_000, 8.0)][:3] == ["4", "8", "12"]
    assert len(lines_of(6, 1000.0)) == 5


def test_a_file_gets_no_line_of_a_study_that_is_done_in_seconds():
    assert lines_of(1_000, 0.002) == []


def test_a_line_in_a_file_tells_how_many_trials_failed():
    assert lines_of(20, 10.0, failing=(0, 3))[:2] == [
        "2 of 20 trials, 1 failed; 0:03:00 left",
        "4 of 20 trials, 2 failed; 0:02:40 left",
    ]


def test_the_speed_is_that_of_the_trials_that_are_done_and_nothing_before_the_first_is():
    now = [0.0]
    bar = rich.progress.Progress(get_time=lambda: now[0])
    task = bar.add_task("trials", total=10)
    speeds = []
    for _ in range(4):
        speeds.append(_Speed().render(bar.tasks[0]).plain)
        now[0] += 0.5
        bar.advance(task)
    assert speeds[0] == ""
    assert speeds[-1] == "2.0/s"
