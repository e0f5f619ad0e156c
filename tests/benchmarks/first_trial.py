"""The bundled dataset, whose models note when the first trial of a study begins; see `large_studies`."""

import json
import os
import time
from pathlib import Path

import psutil

from studies.datasets.bundled import Bundled, BundledModel

STARTED_BY = "STUDIES_STARTED_BY"  # the variable with the id of the process that has started the command
NOTE = "STUDIES_FIRST_TRIAL"  # and that with the path of the file for the note


class Noting(BundledModel):
    """A model that notes when it is read, which is the first thing that a trial does."""

    def load(self):
        _note()
        return super().load()


class Noted(Bundled):
    """The bundled dataset."""

    def models(self):
        return [Noting(model.name, model.category) for model in super().models()]


def _note():
    """Note the seconds since the start of the command, and the CPU seconds of all its processes."""
    path = Path(os.environ[NOTE])
    if path.exists():
        return
    now, command = time.time(), psutil.Process()
    while command.ppid() != int(os.environ[STARTED_BY]):
        command = command.parent()
    times = [process.cpu_times() for process in [command, *command.children(recursive=True)]]
    seconds = sum(each.user + each.system for each in times)
    path.write_text(json.dumps({"seconds": seconds, "elapsed": now - command.create_time()}))
