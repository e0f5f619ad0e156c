"""What every worker process needs, imported once in the process from which workers are forked.

That process must not have threads, because its forks would inherit what a thread has locked. It therefore limits BLAS
to one thread, and imports no pandas, whose Arrow starts threads when it is imported.

It ends as soon as the process that it is started for has: a command with a mistake does not leave it behind at work.
"""

import contextlib
import gc
import os
import signal
import sys
from importlib import import_module

from studies.execution.fork_server import HEAD

NEEDED = (
    "studies.execution.schedule",
    "studies.experiments.change",
    "heatwalk.segmentation",
    "heatwalk.numerics.search",
    "heatwalk.numerics.solver",
    "trimesh",
    # What perturbations import when they are first used: it would count as time that perturbing takes.
    "fast_simplification",
    "perturb._proximity",
    "pymeshlab",
    "scipy.optimize",
    "scipy.sparse.csgraph",
    "scipy.spatial",
)

signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is left to the head process
if sys.platform != "win32":
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # which had it wait until here
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_variable] = "1"
os.environ["MPLBACKEND"] = "Agg"  # workers show nothing
gc.disable()  # what is imported is no garbage
_head = os.environ.pop(HEAD, None)  # where workers are not forked, this is one of them, and it is not set
for _module in NEEDED:
    if _head is not None and os.getppid() != int(_head):
        os._exit(0)
    with contextlib.suppress(Exception):  # this only saves time: a task that needs the module reports the error
        import_module(_module)


def _refuse() -> None:
    raise RuntimeError("it is not in numba's cache")


with contextlib.suppress(Exception):  # nor is it a mistake here if it has to be compiled: a task does that
    from heatwalk.numerics.compilation import announced
    from heatwalk.segmentation import bent_torus, segment

    with announced(_refuse):
        segment(*bent_torus(), threads=1)  # loads what is compiled, for all workers at once
gc.freeze()  # nor do workers look through it, which would copy it to each of them
gc.enable()
