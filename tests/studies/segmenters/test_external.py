import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from heatwalk.io import read_mesh
from studies.execution import Local, TaskFailure
from studies.segmenters import External, make_segmenter
from tests.helpers.meshes import bundled
from tests.studies.execution.engines import outcomes_of, runs, wait_for

# Labels by the side of the mesh on which a vertex, or a face, is.
SIDES = """
import sys
rows = [line.split() for line in open(sys.argv[1])]
n, m = int(rows[1][0]), int(rows[1][1])
x = [float(row[0]) for row in rows[2 : 2 + n]]
faces = [[int(i) for i in row[1:]] for row in rows[2 + n : 2 + n + m]]
labels = x if sys.argv[3] == "vertices" else [sum(x[i] for i in face) for face in faces]
open(sys.argv[2], "w").writelines(f"{int(label > 0)}\\n" for label in labels)
"""


@pytest.fixture(scope="module")
def ant():
    mesh = bundled("ant")
    return np.asarray(mesh.vertices) - mesh.vertices.mean(axis=0), np.asarray(mesh.faces)


@pytest.fixture
def program(tmp_path):
    """A function: Python code -> a command that runs it, on {mesh} and {labels}."""

    def write(code, *words):
        path = tmp_path / "my tool.py"
        path.write_text(code)
        return " ".join([sys.executable, f"'{path}'", "{mesh}", "{labels}", *words])

    return write


def external(command, **options):
    return make_segmenter({"_target_": "studies.segmenters.External", "command": command, **options})


def test_a_program_may_label_vertices(program, ant):
    labels = external(program(SIDES, "vertices"))(*ant)
    assert (labels == (ant[0][:, 0] > 0)).all()


def test_a_program_may_label_faces(program, ant):
    labels = external(program(SIDES, "faces"))(*ant)
    far = np.abs(ant[0][:, 0]) > np.linalg.norm(np.ptp(ant[0][ant[1]], axis=1), axis=1).max()
    assert far.any()
    assert (labels[far] == (ant[0][far, 0] > 0)).all()


@pytest.mark.parametrize("suffix", [".off", ".obj", ".ply"])
def test_the_program_reads_the_mesh_with_all_its_digits(suffix, ant, tmp_path):
    kept = tmp_path / f"kept{suffix}"
    program = External(f"{sys.executable} -c 'import shutil, sys; shutil.copy(*sys.argv[1:3]); "
                       f"open(sys.argv[3], \"w\").write(\"0\")' {{mesh}} '{kept}' {{labels}}", suffix)  # fmt: skip
    assert program(*ant).tolist() == [0]
    mesh = read_mesh(kept)
    assert (mesh.vertices == ant[0]).all()
    assert (mesh.faces == ant[1]).all()


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("import sys; sys.exit('the mesh has no legs')", "exit code 1; the end of its output: the mesh has no legs"),
        ("import os; os.abort()", "exit code 134, without any output"),
        ("print('done')", "wrote no file {labels}; the end of its output: done"),
        ("import sys; open(sys.argv[2], 'w').write('0\\n1.5\\n')", r"line 2 is not a label \(an integer\): '1.5'"),
        ("import sys; open(sys.argv[2], 'w').write('0\\n' * 9)", "returned 9 labels for 486 vertices and 912 faces"),
        ("import sys; open(sys.argv[2], 'w')", "returned 0 labels"),
    ],
)
def test_a_program_that_fails_is_an_error_that_describes_how(code, message, program, ant):
    with pytest.raises(ValueError, match=message):
        external(program(code))(*ant)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("mytool {mesh}", r"lacks \{labels\}: segmenter.command='mytool \{mesh\} \{labels\}'"),
        ("mytool {labels}", r"lacks \{mesh\}: "),
        ("no-such-tool {mesh} {labels}", "the program 'no-such-tool' cannot be found"),
        ("cp '{mesh} {labels}", "No closing quotation"),
    ],
)
def test_a_command_that_cannot_be_run_is_refused_at_once(command, message):
    with pytest.raises(ValueError, match=message):
        external(command)


def test_no_shell_interprets_the_command(ant, tmp_path):
    with pytest.raises(ValueError, match="exit code 1"):
        external(f"cp {{mesh}} {{labels}} && touch {tmp_path}/touched")(*ant)
    assert not list(tmp_path.iterdir())


def test_another_program_in_the_same_file_is_another_segmenter(program):
    before, same = external(program("1")), external(program("1"))
    after = external(program("2"))
    assert before.fingerprint == same.fingerprint != after.fingerprint
    assert before.name == f"{os.path.basename(sys.executable)} my tool.py"


# Reports its process, that of a child, and its folder, and does not end. The folder contains so many files that
# removing it takes a while.
LINGERS = """
import os, pathlib, subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
path = pathlib.Path(sys.argv[3])
for i in range(2000):
    pathlib.Path(sys.argv[1]).with_name(f"{i}").touch()
path.with_suffix(".part").write_text(f"{os.getpid()} {child.pid} {os.path.dirname(sys.argv[1])}")
path.with_suffix(".part").rename(path)
time.sleep(600)
"""


def wait_until_gone(note):
    *pids, folder = note.read_text().split()
    wait_for(lambda: not any(runs(int(pid)) for pid in pids) and not os.path.exists(folder))


class Segment:
    """The work of a trial, for an engine."""

    def __init__(self, mesh):
        self.mesh = mesh

    def __call__(self, segmenter):
        return segmenter(*self.mesh).tolist()


def test_a_program_ends_with_a_worker_whose_time_ran_out(program, ant, tmp_path):
    slow, note = external(program(LINGERS, f"'{tmp_path}/note'")), tmp_path / "note"
    outcome = outcomes_of(Local(workers=1, timeout=3), Segment(ant), [slow])
    assert outcome == {slow: TaskFailure("timeout", "took longer than trial.timeout=3 seconds")}
    wait_until_gone(note)


@pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGINT])
def test_a_program_ends_with_the_process_that_runs_it(ending, program, tmp_path):
    note = tmp_path / "note"
    code = (
        "import sys, numpy as np; from studies.segmenters import External;"
        "External(sys.argv[1])(np.zeros((3, 3)), np.array([[0, 1, 2]]))"
    )
    command = [sys.executable, "-c", code, program(LINGERS, f"'{note}'")]
    head = subprocess.Popen(command, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}, stderr=-3)
    wait_for(note.exists)
    head.send_signal(ending)
    head.wait()
    wait_until_gone(note)


def test_what_a_program_leaves_behind_ends_with_it(program, ant, tmp_path):
    code = LINGERS.replace("time.sleep(600)\n", "open(sys.argv[2], 'w').write('0\\n' * 486)\n")
    assert (external(program(code, f"'{tmp_path}/note'"))(*ant) == 0).all()
    wait_until_gone(tmp_path / "note")
