"""Segmenters for the tests of studies: a fast one, and one that misbehaves."""

import os
import time
from pathlib import Path

import numpy as np

from tests.helpers.meshes import bundled


def halves(vertices, faces, seconds=0.0):
    """Two segments, by x. Fails while the current folder contains a file ``broken``."""
    time.sleep(seconds)
    if Path("broken").exists():
        raise RuntimeError("there is a file 'broken'")
    return (vertices[:, 0] > np.median(vertices[:, 0])).astype(np.int64)


halves.algorithm_version = 1  # otherwise each study reads all files of the tests, whose digest is the version


def by_size(vertices, faces):
    """A segment for every hundred vertices: another number for every size of a mesh."""
    return np.arange(len(vertices)) % (len(vertices) // 100)


def told(vertices, faces, n_segments):
    """As many segments as it is told to find."""
    return np.arange(len(vertices)) % n_segments


def hungry(vertices, faces):
    """As `halves`, with 64 MB of memory while it runs."""
    assert np.ones(64_000_000, dtype=np.uint8)[-1] == 1
    return halves(vertices, faces)


def hostile(vertices, faces):
    """As `halves` for the ant in its original size; in other sizes, what a trial should never do."""
    size = round(np.ptp(vertices[:, 0]) / np.ptp(bundled("ant").vertices[:, 0]))
    if size == 2:
        os.abort()
    if size == 3:
        time.sleep(600)
    if size == 4:
        return len(b"x" * 2**32)
    if size == 5:
        raise RuntimeError("no such luck")
    return halves(vertices, faces)
