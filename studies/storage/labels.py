"""Labels that trials computed, kept for the pictures that show them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.storage.atomic import atomic_write
from studies.storage.folders import LABELS_FOLDER


class LabelStore:
    """Arrays of single trials, in a folder next to the rows of a study.

    Parameters
    ----------
    folder : Path
        the results folder of the study

    Examples
    --------
    >>> import tempfile
    >>> store = LabelStore(tempfile.mkdtemp())
    >>> store.put("0123abcd", {"labels": np.array([0, 0, 1])})
    >>> store.get("0123abcd")
    {'labels': array([0, 0, 1])}
    >>> store.get("4567cdef") is None
    True
    """

    def __init__(self, folder: Path | str) -> None:
        self._folder = Path(folder) / LABELS_FOLDER

    def put(self, trial_id: str, arrays: Mapping[str, NDArray]) -> None:
        """Store the arrays of a trial, in place of those that it has.

        Parameters
        ----------
        trial_id : str
        arrays : mapping of str to array

        Raises
        ------
        OSError
            If they cannot be written; the earlier ones are kept then.
        """
        self._folder.mkdir(exist_ok=True)
        with atomic_write(self._path(trial_id)) as path:
            np.savez_compressed(path, **dict(arrays))  # type: ignore[arg-type]

    def get(self, trial_id: str) -> dict[str, NDArray] | None:
        """The arrays of a trial; None if they are not stored, or their file is damaged."""
        try:
            with np.load(self._path(trial_id), allow_pickle=False) as file:
                arrays = dict(file)
        except Exception:  # NumPy and zipfile raise a dozen kinds for damaged files
            return None
        return arrays if all(isinstance(array, np.ndarray) for array in arrays.values()) else None

    def _path(self, trial_id: str) -> Path:
        return self._folder / f"{trial_id}.npz"
