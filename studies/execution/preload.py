"""What every worker process needs, imported once: `studies.execution.engine` forks the workers from a process that did.

That process must hold no thread, or its forks would inherit what the thread has locked: hence one BLAS thread a
process, and no pandas, whose Arrow starts threads when it is imported.
"""

import contextlib
import os
import signal
from importlib import import_module

_NEEDED = (
    "hydra.utils",
    "studies.execution.schedule",
    "studies.experiments.change",
    "perturb",
    "heatwalk.segmentation",
)

signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is left to the head process
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_variable] = "1"
for _module in _NEEDED:
    with contextlib.suppress(Exception):  # this saves time and nothing else: a task that needs it says what is wrong
        import_module(_module)
