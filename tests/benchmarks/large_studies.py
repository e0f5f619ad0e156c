"""Large studies: what a plan and its store cost, and how many trials a second the head process keeps busy.

    python -m tests.benchmarks.large_studies [--sizes 100000 1000000]

By default the largest plan has ten million trials, whose store takes 14 GB of the folder for temporary files.

Each measurement runs in a fresh process, whose peak memory is that of the whole process. The store is synthetic: each
planned trial but the last has the row of a real one. The workers are simulated: tasks sleep, that is, each of them is
done a given time after it was handed over; everything else is the code that a study runs, with its store on disk.
"""

import argparse
import contextlib
import heapq
import io
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from importlib import import_module
from itertools import count
from pathlib import Path

import psutil

from studies.datasets import Dataset, Model
from tests.benchmarks.first_trial import NOTE, STARTED_BY, Noted

SIZES = (100_000, 1_000_000, 10_000_000)  # the last has a store of 14 GB
MODELS = 100
LEVELS = 10
FINISHED = (1_000, 10_000)  # trials of the studies whose end is measured
TRIALS_TAKE = 15.0  # seconds that all of their trials take together, in which a study imports what its table needs
TARGETS = {"plan": (60.0, 1.0), "resume": (120.0, 1.5)}  # seconds and GB for ten million trials
TABLE_TARGETS = (0.15, 1.5)  # seconds from the last of 1,000 trials to the table, and from the start to the first
RUNS = 5  # of each of these measurements
ROW_BYTES = 1_400  # of a row in the store, about
RATE = 1_000.0  # trials a second
RUN_FOR = 30.0  # seconds of simulated work, of which the start and the end are a part
ROW = {
    "n_vertices": 4706, "n_faces": 9408, "n_vertices_perturbed": 4706, "n_faces_perturbed": 9408, "n_compared": 4706,
    "n_segments_reference": 6, "n_segments": 6, "change_percentage": 0.2974925626859328,
    "van_dongen": 0.2974925626859328, "rand_index_error": 0.0010570989710379452, "seconds_perturb": 0.6949986580002587,
    "seconds_segment": 0.6463606279994565, "peak_memory": 12.5, "status": "ok", "seconds": 0.7, "applied": "x" * 500,
}  # fmt: skip


class Sleeping:
    """An engine whose workers do nothing for some seconds a task, and then return the row of the trial.

    Parameters
    ----------
    workers : int
    seconds : float
        that a task takes
    """

    remote = False

    def __init__(self, workers, seconds):
        self.processes, self.seconds = workers, seconds
        self.handed_over = 0
        self.last = (0.0, 0.0)  # when the last task was done: by the clock, and in CPU seconds of this process

    def warm_up(self):
        pass

    def active(self):
        return []

    @contextlib.contextmanager
    def open(self, function):
        yield _SleepingSession(self)


class _SleepingSession:
    def __init__(self, engine):
        self._engine = engine
        self._free = [0.0] * engine.processes  # when each worker has done what it was given
        self._pending = []
        self._number = count()

    @property
    def pending(self):
        return len(self._pending)

    def has_room(self):
        return len(self._pending) < 2 * self._engine.processes

    def submit(self, task):
        import pickle

        pickle.dumps(task)  # as engines do
        now = time.monotonic()
        free = heapq.heappop(self._free)
        done = max(now, free) + self._engine.seconds
        heapq.heappush(self._free, done)
        heapq.heappush(self._pending, (done, next(self._number), task))
        self._engine.handed_over += 1

    def wait(self):
        if not self._pending:
            return []
        time.sleep(max(0.0, self._pending[0][0] - time.monotonic()))
        now, finished = time.monotonic(), []
        while self._pending and self._pending[0][0] <= now:
            task = heapq.heappop(self._pending)[2]
            finished.append((task, _outcome(task)))
        self._engine.last = time.monotonic(), time.process_time()
        return finished


def _outcome(task):
    from studies.execution.schedule import Preparation, Prepared
    from studies.planning.trial import planned_row

    if isinstance(task, tuple):  # whether the method is compiled
        return True
    if isinstance(task, Preparation):
        return Prepared(b"", 0.0)
    return planned_row(task.trial) | ROW


@dataclass(frozen=True)
class Named(Model):
    """A model without a mesh."""

    def load(self):
        raise NotImplementedError

    def digest(self):
        return self.name * 8


class Names(Dataset):
    """Models without meshes."""

    name = "names"

    def models(self):
        return [Named(f"model{i:04d}", "") for i in range(MODELS)]


def study_of(n, folder, engine=None):
    """A study of ``n`` trials of models without meshes."""
    from studies.experiments.change import Change
    from studies.planning.configuration import Study
    from studies.segmenters import make_segmenter

    return Study(
        name="large",
        title="Large",
        experiment=Change(
            perturbation={"_target_": "perturb.NormalNoise", "unit": "mean_edge_length"},
            levels=[0.1 * i for i in range(1, LEVELS + 1)],
            repeats=n // (MODELS * LEVELS),
            gallery=None,
            page=None,
        ),
        dataset=Names(),
        segmenters=(make_segmenter({"_target_": "studies.segmenters.HeatWalk"}),),
        engine=engine or Sleeping(1, 0.0),
        results_dir=folder,
        folder=folder / "large" / "names",
        record={"study": {"name": "large"}, "title": "Large", "dataset": {}, "experiment": {}},
    )


def plan(n, folder):
    """Seconds of planning and of storing the plan."""
    from studies import storage

    start = time.process_time()
    study = study_of(n, folder)
    planned = study.plan_blocks()
    with storage.RowStore(study.folder) as store:
        store.write_plan(planned.ids)
    return {"seconds": time.process_time() - start}


def fill(n, folder):
    """Write the rows of all trials but the last."""
    from studies.planning.trial import planned_row

    study = study_of(n, folder)
    planned = study.plan_blocks()
    template = json.dumps(planned_row(planned[0]) | ROW | {"trial_id": "@"})
    before, after = template.split('"@"')
    with (study.folder / "trials.jsonl").open("w", encoding="utf-8") as file:
        file.writelines(f'{before}"{trial_id}"{after}\n' for trial_id in planned.ids[:-1])
    return {"bytes": (study.folder / "trials.jsonl").stat().st_size}


def resume(n, folder):
    """Seconds until the first missing trial of a store is known, with planning."""
    from studies import storage
    from studies.execution.study import _missing
    from studies.planning.plan import PlannedRows
    from studies.storage import Origin

    start = time.process_time()
    study = study_of(n, folder)
    planned = study.plan_blocks()
    place = storage.place(study.folder, Origin(study.record, {}, {}), PlannedRows(planned))
    with storage.RowStore(place.folder) as store:
        missing = _missing(study, planned, store)
    assert [trial.trial_id for trial in missing] == [planned.ids[len(planned) - 1]]
    return {"seconds": time.process_time() - start}


def head(workers, folder, seconds=None):
    """Tasks a second of simulated workers, preparations among them, and the share of the time for which they waited."""
    from rich.console import Console

    from studies import storage
    from studies.execution.imports_ahead import OF_TABLE
    from studies.execution.study import _run_missing

    for module in OF_TABLE:  # which a study imports meanwhile, once for any number of trials
        import_module(module)
    engine = Sleeping(workers, workers / RATE if seconds is None else seconds)
    n = int(RATE * RUN_FOR) // 1000 * 1000
    study = study_of(n, folder, engine)
    planned = study.plan_blocks()
    with storage.RowStore(study.folder) as store:
        start, cpu = time.monotonic(), time.process_time()
        _run_missing(study, planned, store, Console(file=io.StringIO()))
        wall, cpu = time.monotonic() - start, time.process_time() - cpu
        assert len(store.status) == n
    idle = 1 - engine.handed_over * engine.seconds / (workers * wall)
    return {"rate": engine.handed_over / wall, "cpu": cpu / n * 1e6, "idle": idle}


def saturated(workers, folder):
    """As `head`, with tasks that take no time."""
    return head(workers, folder, 0.0)


def finish(n, folder):
    """Seconds from the last trial until the table is printed, of a study that takes `TRIALS_TAKE` seconds."""
    from rich.console import Console

    from studies.execution.study import run_study
    from studies.reporting import write

    workers = 64
    engine = Sleeping(workers, TRIALS_TAKE * workers / n)
    study = study_of(n, folder, engine)
    printed, print_table = [], write.print_table

    def print_and_note(*arguments):
        print_table(*arguments)
        printed.append((time.monotonic(), time.process_time()))

    write.print_table = print_and_note
    run_study(study, Console(file=io.StringIO()))
    (wall, cpu), (wall_before, cpu_before) = printed[0], engine.last
    return {"seconds": cpu - cpu_before, "elapsed": wall - wall_before}


def begin(engine, folder):
    """Seconds from the start of a command until its first trial begins, which a worker notes."""
    folder.mkdir(parents=True, exist_ok=True)
    note = folder / "first_trial.json"
    words = ["+study=shot_noise", f"engine={engine}", "dataset=custom", "dataset.models=[cow]", "levels=[0.05]"]
    words += [f"dataset._target_={Noted.__module__}.{Noted.__name__}", "repeats=1", "gallery.models=0"]
    command = [sys.executable, "-m", "studies.run", *words, f"results_dir={folder}"]
    environment = os.environ | {STARTED_BY: str(os.getpid()), NOTE: str(note)}
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
    return json.loads(note.read_text())


def begin_local(_, folder):
    """Seconds until the first trial begins in one of several worker processes, as is the default."""
    return begin("local", folder)


def begin_serial(_, folder):
    """Seconds until the first trial begins in the process of the command itself."""
    return begin("serial", folder)


MEASURES = {
    "finish": finish,
    "begin_local": begin_local,
    "begin_serial": begin_serial,
    "plan": plan,
    "fill": fill,
    "resume": resume,
    "head": head,
    "saturated": saturated,
}


def in_process(name, number, folder):
    """What a measurement in a process of its own returns, with the GB that the process held at most."""
    command = [sys.executable, "-m", "tests.benchmarks.large_studies", "--measure", name, str(number), str(folder)]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return json.loads(printed.splitlines()[-1])


def measured(name, number, folder):
    """As `in_process`, in this process."""
    found = MEASURES[name](number, Path(folder))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return found | {"gb": peak / 1e9}


def fastest(name, number):
    """The shortest times of several runs of a measurement, each in a new folder."""
    found = []
    for _ in range(RUNS):
        with tempfile.TemporaryDirectory() as folder:
            found.append(in_process(name, number, Path(folder) / "results"))
    return {key: min(each[key] for each in found) for key in ("seconds", "elapsed")}


def run(sizes, workers):
    """The lines of the report."""
    lines = [
        "| from | to | CPU s | elapsed s |",
        "| --- | --- | --- | --- |",
    ]
    for engine in ("local", "serial"):
        begun = fastest(f"begin_{engine}", 1)
        lines.append(f"| start | first trial, engine={engine} | {begun['seconds']:.2f} | {begun['elapsed']:.2f} |")
    for n in FINISHED:
        done = fastest("finish", n)
        lines.append(f"| last of {n:,} trials | table | {done['seconds']:.2f} | {done['elapsed']:.2f} |")
    print(*lines, sep="\n", flush=True)
    lines += [
        "",
        "| trials | planning, s | peak, GB | store, GB | planning and resuming, s | peak, GB |",
        "|" + " --- |" * 6,
    ]
    for n in sizes:
        with tempfile.TemporaryDirectory() as name:
            if shutil.disk_usage(name).free < 2 * ROW_BYTES * n:
                print(f"{n:,} trials are left out: {tempfile.gettempdir()} has too little room", file=sys.stderr)
                continue
            planned = in_process("plan", n, name)
            stored = in_process("fill", n, name)
            resumed = in_process("resume", n, name)
        lines.append(
            f"| {n:,} | {planned['seconds']:.1f} | {planned['gb']:.2f} | {stored['bytes'] / 1e9:.2f} "
            f"| {resumed['seconds']:.1f} | {resumed['gb']:.2f} |"
        )
        print(lines[-1], flush=True)
    lines += [
        "",
        "| workers | tasks a second offered | kept busy | workers waited | CPU of the head per trial, µs "
        "| trials a second at which it would break |",
        "|" + " --- |" * 6,
    ]
    for n in workers:
        with tempfile.TemporaryDirectory() as name:
            busy = in_process("head", n, Path(name) / "busy")
            most = in_process("saturated", n, Path(name) / "most")
        lines.append(
            f"| {n:,} | {RATE:,.0f} | {busy['rate']:,.0f} | {100 * busy['idle']:.1f} % | {busy['cpu']:.0f} "
            f"| {most['rate']:,.0f} measured, {1e6 / most['cpu']:,.0f} by its CPU time |"
        )
        print(lines[-1], flush=True)
    return lines


def report(lines):
    """The Markdown of the report."""
    load = psutil.getloadavg()[2]
    (plan_s, plan_gb), (resume_s, resume_gb) = TARGETS["plan"], TARGETS["resume"]
    return "\n".join(
        [
            "# Large studies",
            "",
            "Made by `python -m tests.benchmarks.large_studies`. CPU seconds and peak memory of fresh processes; the "
            f"trials a second are elapsed time. Of the start and the end, the shortest of {RUNS} runs; the CPU seconds "
            "until the first trial are those of all processes, several of which work at the same time. Load average "
            f"of the last 15 minutes: {load:.1f} on {os.cpu_count()} processors. Targets: {TABLE_TARGETS[0]:g} s from "
            f"the last of 1,000 trials to the table, {TABLE_TARGETS[1]:g} s from the start to the first trial; for ten "
            f"million trials, a plan in {plan_s:.0f} s and {plan_gb:g} GB, its store read and resumed in "
            f"{resume_s:.0f} s and {resume_gb:g} GB; {RATE:,.0f} trials a second. The store is synthetic, with rows of "
            "the size of real ones; the workers are simulated by tasks that sleep.",
            "",
            *lines,
            "",
        ]
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--sizes", type=int, nargs="*", default=list(SIZES), help="trials of the plans")
    parser.add_argument("--workers", type=int, nargs="*", default=[64, 1024], help="simulated workers")
    parser.add_argument("--output", type=Path, default=Path("results/performance"))
    parser.add_argument("--measure", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        name, number, folder = options.measure
        print(json.dumps(measured(name, int(number), folder)))
    else:
        written = report(run(options.sizes, options.workers))
        options.output.mkdir(parents=True, exist_ok=True)
        (options.output / "large_studies.md").write_text(written, encoding="utf-8")
        print(written, end="")
