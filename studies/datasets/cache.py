"""Meshes that take seconds to compute, kept on disk between processes."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from studies.storage.atomic import atomic_write

if TYPE_CHECKING:
    from heatwalk.io import LoadedMesh

FOLDER_VARIABLE = "HEATWALK_CACHE_DIR"


def cache_folder() -> Path:
    """The folder of computed meshes: that in the environment variable, else one in the user's cache folder.

    It may be deleted at any time.
    """
    from platformdirs import user_cache_path

    return Path(os.environ.get(FOLDER_VARIABLE) or user_cache_path("heatwalk", appauthor=False)) / "meshes"


def cached_mesh(digest: str, compute: Callable[[], LoadedMesh], folder: Path | None = None) -> LoadedMesh:
    """The mesh stored under a digest; if there is none, it is computed and stored.

    Parameters
    ----------
    digest : str
        hexadecimal digest of all that determines the mesh
    compute : callable
        computes the mesh
    folder : Path, optional
        where meshes are stored; `cache_folder` by default

    Returns
    -------
    LoadedMesh

    Notes
    -----
    A folder that cannot be written to, or a damaged file in it, costs the time to compute the mesh and nothing else.

    Examples
    --------
    >>> import tempfile
    >>> from heatwalk.io import LoadedMesh
    >>> folder = Path(tempfile.mkdtemp())
    >>> mesh = LoadedMesh(np.eye(3), np.array([[0, 1, 2]]), ("a triangle",))
    >>> cached_mesh("5ca1ab1e", lambda: mesh, folder) is mesh
    True
    >>> cached_mesh("5ca1ab1e", lambda: 1 / 0, folder).notes
    ('a triangle',)
    """
    path = (folder or cache_folder()) / f"{digest}.npz"
    stored = _stored(path)
    if stored is not None:
        return stored
    mesh = compute()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as part:
            np.savez(part, vertices=mesh.vertices, faces=mesh.faces, notes=np.array(mesh.notes, dtype=np.str_))
    except OSError:
        pass  # the next process computes it again
    return mesh


def _stored(path: Path) -> LoadedMesh | None:
    """The mesh in a file; None if there is no such file, or it cannot be read."""
    from heatwalk.io import LoadedMesh

    try:
        with np.load(path, allow_pickle=False) as arrays:
            return LoadedMesh(arrays["vertices"], arrays["faces"], tuple(arrays["notes"].tolist()))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
