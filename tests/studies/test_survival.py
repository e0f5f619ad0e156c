"""Studies that are killed, filled, started twice and set to segmenters that do the worst."""

import json
import os
import re
import resource
import signal
import subprocess
import time

import numpy as np
import pandas as pd
import pytest

from studies.planning.trial import TIMINGS
from studies.storage import RowStore, StoredRows, lock_holder
from tests.studies.conftest import STUDY, fork, typed
from tests.studies.execution.engines import wait_for
from tests.studies.test_run import run

pytestmark = pytest.mark.usefixtures("charts_as_text")

FOLDER = "normal_noise/files"


def rows(results="results"):
    frame = pd.read_parquet(f"{results}/{FOLDER}/trials.parquet")
    return frame.drop(columns=list(TIMINGS))


def table(results="results"):
    with open(f"{results}/{FOLDER}/table.csv", "rb") as file:
        return file.read()


def test_a_study_killed_at_twenty_moments_gives_the_rows_and_the_table_of_one_that_was_not(study):
    words = ("repeats=20", "+segmenter.seconds=0.005")
    start = time.monotonic()
    assert study(*words, results="whole")
    whole = time.monotonic() - start
    random = np.random.default_rng(20)
    stored = [0]
    for _ in range(20):
        process = fork.Process(target=study, args=words)
        process.start()
        time.sleep(random.uniform(0, whole / 6))
        process.kill()
        process.join()
        stored.append(len(StoredRows(f"results/{FOLDER}").status))
    assert stored == sorted(stored)  # nothing that was stored is lost
    assert study(*words)
    assert table() == table("whole")
    pd.testing.assert_frame_equal(rows(), rows("whole"))


@pytest.mark.slow
def test_workers_make_no_difference_to_a_study_killed_at_twenty_moments(here):
    words = (*STUDY, "repeats=1000", "+segmenter.seconds=0.02")
    start = time.monotonic()
    assert run(here, *words, "engine.workers=4", "results_dir=whole").returncode == 0
    whole = time.monotonic() - start
    random = np.random.default_rng(20)
    for i in range(20):
        process = run(here, *words, f"engine.workers={1 + i % 3}", wait=False)
        time.sleep(random.uniform(0, whole))
        os.kill(process.pid, signal.SIGKILL)  # the head only; its workers end with it
        process.communicate(timeout=60)
    assert run(here, *words).returncode == 0
    assert table() == table("whole")
    pd.testing.assert_frame_equal(rows(), rows("whole"))


def test_a_killed_study_can_be_shown_before_it_goes_on(study, here):
    from studies import report

    process = fork.Process(target=study, args=("repeats=500", "+segmenter.seconds=0.01"))
    process.start()
    path = here / "results" / FOLDER / "trials.jsonl"
    while not (path.exists() and path.read_bytes().count(b"\n") >= 5):
        assert process.is_alive()
        time.sleep(0.01)
    process.kill()
    process.join()
    assert report.main(["results"]) == 0
    there = path.read_bytes().count(b"\n")
    assert 5 <= len(rows()) == there < 1000
    assert f"{there} trials" in (here / "results" / "README.md").read_text()
    assert rows()["repeat"].tolist() == list(range(there))


@pytest.mark.slow  # tests/studies/test_engine.py has the quick ones
def test_what_a_segmenter_does_becomes_a_row_and_the_others_are_as_if_nothing_was(here):
    words = (
        "+study=scaling", *STUDY[1:-3], "segmenter._target_=tests.helpers.segmenting.hostile", "gallery.models=0",
        "levels=[1,2,3,4,5,0.9,1.1]", "engine.workers=2", "trial.timeout=8", "trial.memory=1.5GB",
    )  # fmt: skip
    done = run(here, *words)
    assert done.returncode == 1, done.stderr
    found = pd.read_parquet("results/scaling/files/trials.parquet").set_index("level")
    assert found["status"].to_dict() == {
        1: "ok", 2: "crashed", 3: "timeout", 4: "crashed", 5: "failed", 0.9: "ok", 1.1: "ok",
    }  # fmt: skip
    assert found["error"].dropna().to_dict() == {
        2: "its process died with exit code -6",
        3: "took longer than trial.timeout=8 seconds",
        4: "out of memory: it held more than trial.memory=1.5GB",
        5: "RuntimeError: no such luck",
    }
    assert "4 of 7 trials failed" in done.stdout


def test_rows_that_were_cut_short_are_said_and_their_trials_run_again(study, capsys):
    assert study("repeats=3")
    before = table()
    path = f"results/{FOLDER}/trials.jsonl"
    with open(path, "rb") as file:
        lines = file.read().splitlines(keepends=True)
    with open(path, "wb") as file:
        file.write(b"".join([lines[0], lines[1][:50] + b"\n", *lines[2:-1], lines[-1][:-20]]))
    capsys.readouterr()
    assert study("repeats=3")
    said = " ".join(capsys.readouterr().out.split())
    assert "2 damaged rows ignored; their trials run again" in said
    assert "4 of them stored already" in said
    assert table() == before


def test_of_two_runs_at_once_the_second_says_who_the_first_is_and_stops(here):
    def hold():
        with RowStore(here / "results" / FOLDER):
            time.sleep(600)

    process = fork.Process(target=hold)
    process.start()
    folder = here / "results" / FOLDER
    wait_for(lambda: lock_holder(folder))
    second = typed(here, *STUDY, "repeats=1")
    assert second.returncode == 2
    assert re.fullmatch(
        rf"studies\.run: error: results/{FOLDER}: process {process.pid} on \S+ since \S+ writes to this folder; .*\n",
        second.stderr,
    )
    process.kill()
    process.join()
    with RowStore(folder) as store:  # its lock ended with it
        pass
    assert list(folder.iterdir()) == [store.path]


@pytest.mark.parametrize("room", range(2000, 20000, 3000))
def test_where_a_file_can_grow_no_further_no_row_is_damaged(study, here, room):
    def limited():
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
        try:
            study("repeats=20")
        except OSError as error:
            os._exit(3 if "File too large; the rows before are stored" in str(error) else 4)

    process = fork.Process(target=limited)
    process.start()
    process.join()
    assert process.exitcode == 3
    there = StoredRows(here / "results" / FOLDER)
    assert there.damaged == 0
    assert (there.path.stat().st_size <= room) & (len(there.status) == there.path.read_bytes().count(b"\n"))


def test_a_full_disk_is_one_clear_line_and_with_more_room_the_study_goes_on(study, here):
    disk = here / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=32k", "tmpfs", str(disk)]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("no permission to mount a small tmpfs")
    try:
        full = typed(here, *STUDY, "repeats=50", "results_dir=disk")
        assert full.returncode == 2
        assert re.fullmatch(
            rf"studies\.run: error: disk/{FOLDER}/trials\.jsonl: No space left on device; .*\n", full.stderr
        )
        kept = (disk / FOLDER / "trials.jsonl").read_bytes()
        assert kept.endswith(b"}\n")
        assert all(json.loads(line)["status"] == "ok" for line in kept.splitlines())
        subprocess.run(["mount", "-o", "remount,size=16m", str(disk)], check=True)
        assert study("repeats=50", results="disk")
        assert (disk / FOLDER / "trials.jsonl").read_bytes().startswith(kept)
        assert study("repeats=50")
        assert table("disk") == table()
    finally:
        subprocess.run(["umount", str(disk)], check=True)
