"""A terminal: an interpreter started with an environment once, and commands run in processes forked from it.

Each command is a process of its own, which ends as Python ends it; but what commands import is imported once, which
takes longer than most commands. ``python -m tests.helpers.terminal`` is the interpreter.
"""

import gc
import json
import os
import runpy
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.helpers.meshes import bundled

STUDY = (
    "+study=normal_noise", "dataset=files", "segmenter=custom", "segmenter._target_=tests.helpers.segmenting.halves",
    "engine=serial", "levels=[0.1]", "repeats=1", "gallery.models=0",
)  # fmt: skip


class Terminal:
    """Runs commands; ends with its context.

    Parameters
    ----------
    has_charts : bool
        whether it has drawn a chart, and so imported matplotlib, before it runs commands
    environment : mapping of str to (str or None)
        variables that differ from those of this process; None removes one
    """

    def __init__(self, has_charts=True, **environment):
        settings = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "COLUMNS": "80"} | environment
        settings = {name: value for name, value in settings.items() if value is not None}
        words = [sys.executable, "-m", __name__, *(["charts"] if has_charts else [])]
        self.process = subprocess.Popen(words, env=settings, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()

    def run(self, folder, words, unread=(), **environment):
        """What ``python -m WORDS`` gives in a folder: CompletedProcess of bytes.

        What is written to the streams whose numbers are in ``unread`` goes to a pipe that nobody reads any more. The
        variables of the environment are for what reads them later than the start of the interpreter.
        """
        with TemporaryDirectory() as files:
            paths = {number: os.path.join(files, str(number)) for number in (1, 2)}
            for path in paths.values():
                Path(path).touch()
            streams = [None if number in unread else path for number, path in paths.items()]
            order = [str(folder), list(words), environment, streams]
            print(json.dumps(order), file=self.process.stdin, flush=True)
            code = int(self.process.stdout.readline())
            output, errors = (Path(path).read_bytes() for path in paths.values())
        return subprocess.CompletedProcess(words, code, output, errors)


def import_all(*, of_charts=True):
    """Run a study, so that whatever studies import and compile is there; without its chart, matplotlib is not."""
    from hydra import compose, initialize_config_module
    from rich.console import Console

    from heatwalk.segmentation import compile_ahead
    from studies.execution import Serial, run_trials
    from studies.execution.study import run_study
    from studies.planning.configuration import configure

    compile_ahead()
    with TemporaryDirectory() as folder, initialize_config_module("conf", version_base="1.3"):
        bundled("ant").export(Path(folder) / "ant.off")
        words = [*STUDY, f"dataset.glob={folder}/ant.off", f"results_dir={folder}"]
        study = configure(compose("config", words), words)
        if of_charts:
            assert run_study(study, Console(quiet=True)).complete
        else:
            import fontTools.subset  # noqa: F401
            import pyvista  # noqa: F401

            assert [row["status"] for row in run_trials(Serial(), study.plan())] == ["ok"]


def _serve():
    """Fork a process per line of standard input; there, return the module to run, and here, wait until it has ended."""
    while line := sys.stdin.readline():
        folder, (module, *words), environment, streams = json.loads(line)
        child = os.fork()
        if not child:
            _redirect(streams)
            os.environ.update(environment)
            os.chdir(folder)
            sys.path[0] = folder  # as of every interpreter that is started there with -m
            sys.argv = [module, *words]
            sys.modules.pop(module, None)  # it runs as __main__
            return module
        os.write(1, b"%d\n" % os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    return None


def _redirect(streams):
    """Have file descriptors 1 and 2 write to files, or to a pipe without a reader in place of None."""
    for number, path in enumerate(streams, 1):
        if path is None:
            reading, target = os.pipe()
            os.close(reading)
        else:
            target = os.open(path, os.O_WRONLY)
        os.dup2(target, number)
        os.close(target)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)


if __name__ == "__main__":
    gc.disable()  # what is imported is no garbage
    import_all(of_charts="charts" in sys.argv)
    assert ("matplotlib" in sys.modules) == ("charts" in sys.argv)
    gc.freeze()  # what is there is not looked through again, by the processes that are forked
    gc.enable()
    command = _serve()
    if command:
        runpy.run_module(command, run_name="__main__", alter_sys=True)
