"""What results were made with, and from what."""

import functools
import platform
import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import heatwalk

PROJECT = Path(__file__).parents[2]
CODE = ("heatwalk", "perturb", "studies", "conf")  # folders of the project that determine its results

# Packages that results depend on: what computes or compiles it, and what reads the meshes.
PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "llvmlite",
    "trimesh",
    "pymeshlab",
    "fast-simplification",
    "pyvista",
    "vtk",
    "pandas",
    "pyarrow",
    "hydra-core",
)


# What tells when and with what results were made.
MADE_WITH = ("made", "commit", "version", "algorithm_version", "python", "platform", "packages", "segmenter_versions")


def provenance(meshes: Mapping[str, str], command: str) -> dict[str, Any]:
    """What the results of a study are made with and from, for provenance.json.

    Parameters
    ----------
    meshes : mapping of str to str
        name of each model -> SHA-256 of its mesh
    command : str
        the command that makes the results again, "" if there is none

    Returns
    -------
    dict
        values that JSON can represent
    """
    return {
        "command": command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": commit(),
        "version": heatwalk.__version__,
        "algorithm_version": heatwalk.ALGORITHM_VERSION,
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "packages": dict(_versions()),
        "meshes_sha256": dict(meshes),
    }


def commit() -> str | None:
    """The commit of the checkout that this code runs from, with "+changes" if it was changed; None if there is none."""
    try:
        if not _git("ls-files", str(Path(__file__).relative_to(PROJECT))):
            return None
        return _git("rev-parse", "HEAD") + ("+changes" if _git("status", "--porcelain", "--", *CODE) else "")
    except (OSError, subprocess.CalledProcessError):
        return None


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=PROJECT, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@functools.cache
def _versions() -> dict[str, str]:
    """The versions of ``PACKAGES``, which do not change while this process runs."""
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue  # installed in another way, without metadata
    return versions
