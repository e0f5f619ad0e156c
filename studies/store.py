"""Rows on disk, each written as it is made, keyed by what determines it."""

import json
import os
from pathlib import Path

import pandas as pd

from studies.trial import COLUMNS


class Store:
    """The rows of one results folder: ``trials.jsonl``, one row a line, only ever appended to.

    A later row of the same trial replaces an earlier one. A line that a crash cut short is dropped, and counted in
    ``damaged``; its trial runs again.
    """

    def __init__(self, folder):
        self.path = Path(folder) / "trials.jsonl"
        self.rows = {}
        self.damaged = 0
        self.path.parent.mkdir(parents=True, exist_ok=True)
        if self.path.exists():
            self._read()
        self._file = self.path.open("ab")

    def add(self, row):
        """Keep a row; it is on disk when this returns."""
        self.rows[row["trial_id"]] = row
        self._file.write((json.dumps(row) + "\n").encode())
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self):
        self._file.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def frame(self, trial_ids, further=None):
        """The stored rows of these trials, in this order: a DataFrame.

        further : the columns behind ``COLUMNS``, with their types
        """
        columns = COLUMNS | (further or {})
        rows = [self.rows[i] for i in trial_ids if i in self.rows]
        return pd.DataFrame(rows, columns=list(columns)).astype(columns)

    def _read(self):
        content = self.path.read_bytes()
        for line in content.splitlines():
            try:
                row = json.loads(line)
                self.rows[row["trial_id"]] = row
            except (ValueError, KeyError, TypeError):
                self.damaged += 1
        if content and not content.endswith(b"\n"):
            # Or the next row would be glued to the cut one.
            with self.path.open("ab") as file:
                file.write(b"\n")
