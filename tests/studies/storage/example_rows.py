"""Rows for the tests of storage."""

from studies.planning.trial import COLUMNS


def row(trial_id, **values):
    """A successful row with the given values."""
    return dict.fromkeys(column.name for column in COLUMNS) | {
        "trial_id": trial_id, "status": "ok", "repeat": 0, "seed": 1, **values,
    }  # fmt: skip
