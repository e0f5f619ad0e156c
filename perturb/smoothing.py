"""Smoothing of the surface, which rounds its details off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._displacement import deform
from perturb.meshes import LENGTHS, as_trimesh
from perturb.perturbation import Parameters, Perturbation, Perturbed

if TYPE_CHECKING:
    import trimesh
    from scipy.sparse import csr_array

LAMBDA = 0.5  # share of the way to the mean of its neighbours that a vertex moves in one step
MU = 1 / (1 / LAMBDA - 0.1)  # the same for the way back in Taubin's method, whose pass-band frequency is 0.1


@dataclass(frozen=True)
class Smoothing(Perturbation):
    """Move every vertex towards the mean of its neighbours, several times. Deterministic.

    Parameters
    ----------
    amount : int
        How many iterations.
    unit : str
        "iterations".
    method : str
        "laplacian": each iteration moves every vertex half of the way to the mean of its neighbours, so the shape
        shrinks, thin parts first. "taubin": each iteration is such a step and a slightly larger one back, which keeps
        the size, and large features, nearly as they are.

    Notes
    -----
    Neighbours count alike, whatever their distance, so k iterations smooth over about √k edge lengths: a finer mesh of
    the same shape is smoothed less. Open boundaries shrink too. `Perturbed.applied` contains the area and, for a closed
    surface, the volume relative to those before.

    References
    ----------
    Taubin 1995, doi:10.1145/218380.218473. Computed by `trimesh.smoothing`.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> box = trimesh.creation.box().subdivide().subdivide()
    >>> for method in ("laplacian", "taubin"):
    ...     smoothed = perturb.Smoothing(amount=10, method=method)(box, np.random.default_rng(0))
    ...     print(method, round(smoothed.applied["volume_ratio"], 2))
    laplacian 0.32
    taubin 1.03
    """

    amount: float = 10
    unit: str = "iterations"
    method: str = "laplacian"

    name: ClassVar[str] = "smoothing"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("iterations",), "method": ("laplacian", "taubin")}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", whole=True)

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        from trimesh.smoothing import filter_laplacian, filter_taubin

        # Around the origin in a box of size 1, so that neither rounding nor the unit of the mesh matters.
        diagonal = LENGTHS["bounding_box_diagonal"](mesh)
        before = as_trimesh((np.asarray(mesh.vertices) - mesh.bounds.mean(axis=0)) / diagonal, mesh.faces)
        after = as_trimesh(before.vertices, before.faces)
        means = _means_of_neighbours(mesh)
        if self.method == "taubin":  # trimesh counts the step forth and the step back as two
            filter_taubin(after, LAMBDA, MU, 2 * int(self.amount), means)
        else:
            filter_laplacian(after, LAMBDA, int(self.amount), volume_constraint=False, laplacian_operator=means)
        result, counterpart, facts = deform(self, mesh, diagonal * np.asarray(after.vertices - before.vertices))
        return self.finish(
            mesh,
            result,
            counterpart,
            area_ratio=float(after.area / before.area),
            volume_ratio=float(after.volume / before.volume) if before.is_volume else None,
            **facts,
        )


def _means_of_neighbours(mesh: trimesh.Trimesh) -> csr_array:
    """(n, n) the matrix that takes functions on the vertices to the means over their neighbours.

    The mean is the vertex itself where it has none.
    """
    from scipy.sparse import coo_array, diags_array

    n_vertices = len(mesh.vertices)
    start, end = mesh.edges_unique[np.diff(mesh.edges_unique, axis=1).ravel() != 0].T
    lonely = np.setdiff1d(np.arange(n_vertices), np.r_[start, end])
    rows, columns = np.r_[start, end, lonely], np.r_[end, start, lonely]
    adjacency = coo_array((np.ones(len(rows)), (rows, columns)), shape=(n_vertices, n_vertices)).tocsr()
    return (diags_array(1 / adjacency.sum(axis=1)) @ adjacency).tocsr()
