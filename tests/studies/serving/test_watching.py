from studies.serving.watching import FolderWatch
from studies.storage import RowStore, following, summarize
from studies.storage.rows import parse_line
from tests.studies.storage.example_rows import row


class Clock:
    """A clock that stands still."""

    now = 100.0

    def __call__(self):
        return self.now


def test_the_time_left_is_that_of_the_missing_trials_at_the_speed_of_those_that_were_watched(tmp_path):
    clock = Clock()
    watch = FolderWatch(tmp_path, clock)
    with RowStore(tmp_path) as store:
        store.write_plan([f"{i}" for i in range(100)])
        store.add_all(row(f"{i}") for i in range(50))  # stored before: they tell nothing about speed
        watch.summary()
        assert watch.seconds_left() is None
        clock.now += 20
        store.add_all(row(f"{i}") for i in range(50, 60))
        watch.summary()
        assert watch.seconds_left() == 80.0
        clock.now += 5
        watch.summary()
        assert watch.seconds_left() == 75.0
    watch.summary()
    assert watch.seconds_left() is None


def test_what_is_read_little_by_little_is_what_is_read_at_once(tmp_path):
    watch = FolderWatch(tmp_path)
    with RowStore(tmp_path) as store:
        store.write_plan(["a", "b", "c", "d"])
        for added in (row("a", seconds_segment=1.5), row("b", status="failed"), row("x"), row("b"), row("c")):
            store.add(added)
            assert watch.summary() == summarize(tmp_path)
    assert [each["trial_id"] for each in watch.latest] == ["a", "b", "x", "b", "c"]
    assert [each["trial_id"] for each in watch.failures] == ["b"]
    assert watch.summary().statuses == {"ok": 3}


def test_rows_that_were_read_are_not_read_again(tmp_path, monkeypatch):
    parsed = []
    monkeypatch.setattr(following, "parse_line", lambda line: parsed.append(line) or parse_line(line))
    watch = FolderWatch(tmp_path)
    with RowStore(tmp_path) as store:
        for i in range(5):
            store.add(row(f"{i}"))
            watch.summary()
            watch.summary()
    assert len(parsed) == 5


def test_a_study_that_is_started_afresh_is_read_afresh(tmp_path):
    watch = FolderWatch(tmp_path / "a")
    with RowStore(tmp_path / "a") as store:
        store.add(row("1", status="failed"), row("2"))
    watch.summary()
    with RowStore(tmp_path / "a", fresh=True) as store:
        store.add(row("3"))
        assert watch.summary() == summarize(tmp_path / "a")
    assert [each["trial_id"] for each in watch.latest] == ["3"]
    assert not watch.failures
