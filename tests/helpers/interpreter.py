"""A Python interpreter that runs many commands, each in a process of its own, and imports libraries only once.

A command that computes for a second imports for five. The interpreter imports libraries once and is forked for each
command; what a command does, prints and returns is what it does in an interpreter that was started for it, except that
those libraries are there already. Tests of what is imported, of a terminal or of a signal start an interpreter instead.
"""

import atexit
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

# What studies, their charts and their pictures load from elsewhere.
LIBRARIES = (
    "numba", "scipy.sparse.csgraph", "scipy.sparse.linalg", "scipy.optimize", "scipy.ndimage", "pandas",
    "pyarrow.parquet", "psutil", "threadpoolctl", "loky", "hydra.main", "hydra.core.plugins", "omegaconf",
    "rich.console", "rich.progress", "trimesh", "pymeshlab", "fast_simplification", "pyvista",
    "pyvista.plotting.plotter", "matplotlib.figure", "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_pdf",
)  # fmt: skip

COMPILED = "import heatwalk.segmentation; heatwalk.segmentation.compile_ahead()"  # what segmenting takes from a cache


class Interpreter:
    """A Python process that is forked for each command.

    Parameters
    ----------
    root : path
        folder from which the packages of this project are imported
    prepare : str
        code that runs before the first command, after ``LIBRARIES`` have been imported
    """

    def __init__(self, root: Path, prepare: str = ""):
        self._path = str(root)
        environment = os.environ | {"PYTHONPATH": self._path}
        self._process = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=root, env=environment
        )
        self._send((LIBRARIES, prepare))

    def run(
        self, words: Sequence[str | Path], cwd: Path, variables: Mapping[str, str] | None = None
    ) -> subprocess.CompletedProcess:
        """What ``python WORDS`` gives in a folder, with ``variables`` in its environment; it reads nothing."""
        words = [str(word) for word in words]
        environment = dict(os.environ) | {"PYTHONPATH": self._path} | dict(variables or {})
        with tempfile.TemporaryDirectory() as folder:
            files = [Path(folder) / name for name in ("stdout", "stderr")]
            self._send((words, str(cwd), environment, [str(path) for path in files]))
            exit_code = pickle.load(self._process.stdout)
            texts = [path.read_text(encoding=environment.get("PYTHONIOENCODING", "utf-8")) for path in files]
            return subprocess.CompletedProcess(words, exit_code, *texts)

    def close(self) -> None:
        """End the process."""
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()

    def _send(self, message) -> None:
        pickle.dump(message, self._process.stdin)
        self._process.stdin.flush()


def next_command() -> list[str]:
    """Fork for each command that is asked for; returns in the process that is to run it, its words."""
    import gc
    import importlib
    from contextlib import suppress

    sys.path.pop(0)  # the folder of this file
    modules, prepare = pickle.load(sys.stdin.buffer)
    gc.disable()  # what is imported is no garbage
    for module in modules:
        importlib.import_module(module)
    exec(prepare, {})
    gc.freeze()
    gc.enable()
    while True:
        try:
            words, cwd, environment, files = pickle.load(sys.stdin.buffer)
        except EOFError:
            os._exit(0)
        child = os.fork()
        if not child:
            break
        pickle.dump(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), sys.stdout.buffer)
        sys.stdout.buffer.flush()
    for number, path in enumerate([os.devnull, *files]):
        file = os.open(path, os.O_RDWR | os.O_CREAT)
        os.dup2(file, number)
        os.close(file)
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(environment)
    if "PYTHONIOENCODING" in environment:
        sys.stdout.reconfigure(encoding=environment["PYTHONIOENCODING"])
        sys.stderr.reconfigure(encoding=environment["PYTHONIOENCODING"])
    importlib.invalidate_caches()
    with suppress(AttributeError):  # a module of Linux
        keep_a_fork_server_ready()
    return words


def keep_a_fork_server_ready() -> None:
    """Let the fork server that this process may start be a fork of what it is now, not another interpreter."""
    import socket
    from multiprocessing import util

    spawn = util.spawnv_passfds
    here, there = socket.socketpair()
    server = os.fork()
    if not server:
        here.close()
        become_fork_server(there)
    there.close()

    def spawn_or_wake(path, arguments, file_descriptors):
        code = os.fsdecode(arguments[-1])
        if here.fileno() < 0 or "multiprocessing.forkserver" not in code:
            return spawn(path, arguments, file_descriptors)
        message = pickle.dumps((code, dict(os.environ), list(file_descriptors)))
        with here:
            socket.send_fds(here, [len(message).to_bytes(4)], file_descriptors)
            here.sendall(message)
        return server

    util.spawnv_passfds = spawn_or_wake


def become_fork_server(asked) -> None:
    """Wait for the code that a fork server runs, and run it; exit if the process that may ask for it has ended."""
    import fcntl
    import socket

    size, received, *_ = socket.recv_fds(asked, 4, 16)
    if not size:
        os._exit(0)
    with asked.makefile("rb") as stream:
        code, environment, wanted = pickle.loads(stream.read(int.from_bytes(size)))
    asked.close()
    out_of_the_way = [fcntl.fcntl(file, fcntl.F_DUPFD, 512) for file in received]
    for file in received:
        os.close(file)
    for file, number in zip(out_of_the_way, wanted, strict=True):
        os.dup2(file, number)
        os.close(file)
    os.environ.clear()
    os.environ.update(environment)
    sys.path.insert(0, "")
    exec(code, {"__name__": "__main__"})
    os._exit(0)


def run_command(words: Sequence[str]) -> None:
    """What ``python WORDS`` does: a module, code or a file."""
    import runpy
    import types

    if words[0] == "-c":
        sys.path.insert(0, "")
        sys.argv = ["-c", *words[2:]]
        main = types.ModuleType("__main__")
        sys.modules["__main__"] = main
        exec(compile(words[1], "<string>", "exec"), main.__dict__)
    elif words[0] == "-m":
        sys.path.insert(0, os.getcwd())
        sys.argv = list(words[1:])
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        sys.path.insert(0, str(Path(words[0]).parent))
        sys.argv = list(words)
        runpy.run_path(words[0], run_name="__main__")


def exit_code_of(words: Sequence[str]) -> int:
    """Run a command: the exit code of its process."""
    try:
        run_command(words)
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    except BaseException:
        sys.excepthook(*sys.exc_info())
        return 1
    return 0


def skip_the_end(ended: Sequence[int]) -> None:
    """Exit with the code in a list, without taking down what was imported, which takes a second."""
    if ended:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(ended[0])


if __name__ == "__main__":
    ended: list[int] = []
    atexit.register(skip_the_end, ended)  # the first one is called last, when threads and all others have ended
    ended.append(exit_code_of(next_command()))
