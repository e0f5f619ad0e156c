"""What the engine adds to the time of the trials: throughput, overhead, start and resume of a large plan, memory.

    python -m tests.benchmarks.engine [--only throughput overhead plan]

Each study is run by the command that a user types. The values are meaningful on a machine that does nothing else; the
load average is printed with them.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import loky
import psutil
from rich.console import Console
from rich.table import Table

from tests.helpers.meshes import bundled

MESHES = 5  # of some 5,000 vertices each: the bundled bone, refined, under five names
STUDY = ("+study=normal_noise", "dataset=files", "gallery.models=0")
INSTANT = ("segmenter=custom", "segmenter._target_=tests.helpers.segmenting.halves")
PLANNED = 100_000


def throughput(folder):
    """Trials per second of two workers over those of one, in the same study of 200 trials."""
    rates = {}
    for workers in (1, 2):
        words = (*STUDY, *refined(folder), "repeats=20", "levels=[0.1,0.2]", f"engine.workers={workers}")
        rates[workers] = rate(*watched(folder, *words, f"results_dir=throughput{workers}")[:2])
    return [("trials per second, 2 workers over 1", "≥ 1.8", f"{rates[2] / rates[1]:.2f}")]


def overhead(folder):
    """Wall time of 500 trials beyond the sum of their own seconds per worker."""
    lines = []
    for workers in (1, 2):
        words = (*STUDY, *refined(folder), "repeats=20", f"engine.workers={workers}")
        wall, rows = watched(folder, *words, f"results_dir=overhead{workers}")[:2]
        own = sum(row["seconds"] for _, row in rows) / workers
        running = rows[-1][0] - rows[0][0] + rows[0][1]["seconds"]
        lines += [
            (f"overhead while trials run, {workers} workers", "< 5 %", f"{100 * (running - own) / own:.1f} %"),
            (f"overhead with start and tables, {workers} workers", "", f"{100 * (wall - own) / own:.1f} %"),
        ]
    return lines


def plan(folder):
    """Seconds until a large plan starts, and until it goes on after a kill; memory of the head process."""
    bundled("ant").export(folder / "ant.off")
    words = (*STUDY, *INSTANT, "dataset.glob=ant.off", f"repeats={PLANNED // 5}", "results_dir=plan")
    lines = []
    for name, target, rows in (("start", "≤ 5 s", 2_000), ("resume", "≤ 10 s", 2_000)):
        _, found, memory = watched(folder, *words, stop_after=rows)
        lines.append((f"{PLANNED:,} planned: seconds to {name}", target, f"{found[0][0]:.1f} s"))
        lines.append((f"memory of the head over {rows:,} trials", "flat", f"{memory[0]:.0f} … {memory[-1]:.0f} MB"))
    path = folder / "plan" / "normal_noise" / "files" / "trials.jsonl"
    ids = path.with_name("planned.txt").read_text().splitlines()
    row = json.loads(path.read_bytes().splitlines()[0])
    path.write_text("".join(json.dumps(row | {"trial_id": trial_id}) + "\n" for trial_id in ids[:-2_000]))
    _, found, memory = watched(folder, *words, stop_after=1_000)
    lines.append((f"{PLANNED:,} planned, all but 2,000 stored: seconds to resume", "≤ 10 s", f"{found[0][0]:.1f} s"))
    lines.append(("memory of the head then", "flat", f"{memory[0]:.0f} … {memory[-1]:.0f} MB"))
    return lines


def refined(folder):
    """Options for meshes of some 5,000 vertices, which are created first."""
    mesh = bundled("bone").subdivide_loop(1)
    (folder / "meshes").mkdir(exist_ok=True)
    for i in range(MESHES):
        mesh.export(folder / "meshes" / f"bone{i}.off")
    return (f"dataset.glob={folder / 'meshes'}",)


def rate(wall, rows):
    """Trials per second between the first and the last row."""
    return (len(rows) - 1) / (rows[-1][0] - rows[0][0])


def watched(folder, *words, stop_after=None):
    """Run a study and watch its rows.

    Parameters
    ----------
    folder : Path
        where it runs
    *words : str
        its options
    stop_after : int, optional
        number of new rows after which it is killed

    Returns
    -------
    tuple
        its seconds; (seconds since its start, row) of every new row; MB that its head process held at these times
    """
    results = next(word.partition("=")[2] for word in words if word.startswith("results_dir="))
    path = folder / results / "normal_noise" / "files" / "trials.jsonl"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    before = path.stat().st_size if path.exists() else 0
    start = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "studies.run", *words], cwd=folder, env=environment, stdout=subprocess.DEVNULL
    )
    head, rows, memory, rest = psutil.Process(process.pid), [], [], b""
    while not path.exists() and process.poll() is None:
        time.sleep(0.005)
    with path.open("rb") as file:
        file.seek(before)
        while process.poll() is None and (stop_after is None or len(rows) < stop_after):
            *lines, rest = (rest + file.read()).split(b"\n")
            now = time.monotonic() - start
            rows += [(now, json.loads(line)) for line in lines]
            if lines:
                memory.append(head.memory_info().rss / 1e6)
            time.sleep(0.005)
    if process.poll() is None:
        process.kill()
    process.wait()
    return time.monotonic() - start, rows, memory


def main():
    parser = argparse.ArgumentParser(prog="tests.benchmarks.engine", description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", nargs="+", choices=MEASURES, default=list(MEASURES), help="(default: all)")
    table = Table("measure", "target", "value")
    load = psutil.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        for name in parser.parse_args().only:
            for line in MEASURES[name](Path(folder)):
                table.add_row(*line)
    console = Console()
    console.width = max(console.width, 110)
    console.print(table)
    load_after = psutil.getloadavg()[0]
    console.print(f"{loky.cpu_count()} processors; load average {load:.1f} before, {load_after:.1f} after")


MEASURES = {"throughput": throughput, "overhead": overhead, "plan": plan}


if __name__ == "__main__":
    main()
