import io

from rich.console import Console

from studies.reporting.progress import Progress


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


def test_a_file_sees_nothing_of_it():
    assert shown() == ""
