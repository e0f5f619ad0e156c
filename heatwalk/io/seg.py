"""SEG files of the Princeton Segmentation Benchmark: one face label per line, in the order of the faces."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heatwalk.io.integers import read_integers


def read_seg(path: str | Path) -> NDArray[np.int64]:
    """Read the face labels of a .seg file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    (m,) int64 array, labels 0, 1, 2 …

    Raises
    ------
    MeshError
        if the file cannot be read, is empty, or has a line that is not one label; the message gives the line number

    Examples
    --------
    >>> import tempfile
    >>> from heatwalk.io import read_seg, write_seg
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "mesh.seg")
    ...     write_seg(path, [0, 0, 2, 1])
    ...     read_seg(path)
    array([0, 0, 2, 1])
    """
    return read_integers(path, "a label (0, 1, 2 …)")


def write_seg(path: str | Path, face_labels: ArrayLike) -> None:
    """Write face labels, one per line.

    Parameters
    ----------
    path : str or Path
    face_labels : (m,) int array

    Raises
    ------
    OSError
        if the file cannot be written
    """
    Path(path).write_bytes(seg_bytes(face_labels))


def seg_bytes(face_labels: ArrayLike) -> bytes:
    """The contents of the file that `write_seg` writes."""
    labels = np.asarray(face_labels)
    if not labels.size or labels.dtype.kind not in "iu" or labels.min() < 0 or labels.max() > len(labels):
        return "".join(f"{label}\n" for label in labels.tolist()).encode("ascii")
    lines = [b"%d\n" % label for label in range(int(labels.max()) + 1)]  # labels are few, faces many
    return b"".join(map(lines.__getitem__, labels.tolist()))
