"""Displacement of vertices, and what it really was."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

import numpy as np

from perturb.meshes import LENGTHS, moved, size_exponent
from perturb.perturbation import PerturbationError

if TYPE_CHECKING:
    import trimesh

    from perturb.perturbation import Perturbation, Scalar

MAX_SHARE_WITHOUT_NORMAL = 0.01  # of the vertices with faces
MAX_ROUNDING = 0.01  # of the requested displacement, as root mean squares


class MoveFacts(TypedDict):
    """What a displacement of vertices really was, in the mesh's own unit."""

    vertices_moved: int
    largest_displacement: float
    rms_displacement: float


def require_normals(normals: np.ndarray, mesh: trimesh.Trimesh, name: str) -> None:
    """Raise PerturbationError if more than a few of the vertices on the surface have no normal to move along."""
    used = np.unique(mesh.faces)
    missing = int(np.count_nonzero(~normals[used].any(axis=1)))
    if missing > MAX_SHARE_WITHOUT_NORMAL * len(used):
        raise PerturbationError(
            f"{name}: {missing} of {len(used)} vertices with faces have no normal to move along, because all their "
            "faces are degenerate; remove the degenerate faces, or merge the vertices that coincide"
        )


def displace(
    mesh: trimesh.Trimesh, normals: np.ndarray, lengths: np.ndarray, name: str
) -> tuple[trimesh.Trimesh, np.ndarray, dict[str, Scalar]]:
    """Move vertices along their normals.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    normals : (n, 3) float array
        Unit vectors; zero for vertices that cannot move.
    lengths : (n,) float array
        Signed lengths, in the mesh's own unit.
    name : str
        Name of the perturbation, for messages.

    Returns
    -------
    mesh : trimesh.Trimesh
    counterpart : (n,) int array
    facts : dict
        For `Perturbed.applied`, measured on the result: the number of vertices that moved, their largest displacement
        and its root mean square, and the number of vertices without a normal.

    Raises
    ------
    PerturbationError
        If the coordinates are so large that rounding them changes the displacement by more than MAX_ROUNDING.
    """
    result, counterpart, facts = move(mesh, lengths[:, None] * normals, name)
    return (
        result,
        counterpart,
        {
            "vertices_moved": facts["vertices_moved"],
            "largest_displacement": facts["largest_displacement"],
            "rms_displacement": facts["rms_displacement"],
            "vertices_without_normal": int(np.count_nonzero(~normals.any(axis=1))),
        },
    )


def deform(
    perturbation: Perturbation, mesh: trimesh.Trimesh, displacement: np.ndarray
) -> tuple[trimesh.Trimesh, np.ndarray, dict[str, Scalar]]:
    """Move vertices by (n, 3) displacements, in the mesh's own unit, with facts as shares of the diagonal.

    Raises
    ------
    PerturbationError
        If no vertex moves although the amount is not the neutral one, or as for `displace`.
    """
    result, counterpart, facts = move(mesh, displacement, perturbation.name)
    if facts["vertices_moved"] == 0 and perturbation.amount != perturbation.neutral:
        raise PerturbationError(
            f"{perturbation.name}, {perturbation.amount:g} {perturbation.unit}: no vertex would move; choose a larger "
            "amount"
        )
    diagonal = LENGTHS["bounding_box_diagonal"](mesh)
    return (
        result,
        counterpart,
        {
            "vertices_moved": facts["vertices_moved"],
            "largest_displacement_over_diagonal": facts["largest_displacement"] / diagonal,
            "rms_displacement_over_diagonal": facts["rms_displacement"] / diagonal,
        },
    )


def move(mesh: trimesh.Trimesh, requested: np.ndarray, name: str) -> tuple[trimesh.Trimesh, np.ndarray, MoveFacts]:
    """Add (n, 3) displacements to the vertices; facts measured on the result, and errors as for `displace`."""
    result, counterpart = moved(mesh, requested)
    actual = np.asarray(result.vertices) - np.asarray(mesh.vertices)
    exponent = size_exponent(mesh)  # so that squares neither overflow nor underflow
    distance = np.linalg.norm(np.ldexp(actual, -exponent), axis=1)
    off = np.ldexp(actual - requested, -exponent)
    asked = np.ldexp(requested, -exponent)
    if np.sqrt((off**2).sum()) > MAX_ROUNDING * np.sqrt((asked**2).sum()):
        largest = np.ldexp(np.linalg.norm(asked, axis=1).max(), exponent)
        raise PerturbationError(
            f"{name}: displacements of up to {largest:.3g} are lost in the rounding of coordinates of up "
            f"to {np.abs(mesh.vertices).max():.3g}; choose a larger amount, or move the mesh to the origin"
        )
    moving = distance[distance > 0]
    return (
        result,
        counterpart,
        {
            "vertices_moved": len(moving),
            "largest_displacement": float(np.ldexp(moving.max(initial=0.0), exponent)),
            "rms_displacement": float(np.ldexp(np.sqrt((moving**2).mean()), exponent)) if len(moving) else 0.0,
        },
    )
