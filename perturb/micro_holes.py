"""Many tiny holes, scattered over the surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._drawing import require_enough
from perturb.holes import triangles_of
from perturb.meshes import edge_graph, without_faces
from perturb.perturbation import Parameters, Perturbation, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class MicroHoles(Perturbation):
    """Remove random triangles or 1-rings of vertices, scattered so that no two holes touch where that is possible.

    Parameters
    ----------
    amount : float
        The share, 0 to 1, of the vertices with faces whose 1-rings are removed, or of the triangles.
    unit : str
        "share_of_vertices": each hole consists of all triangles at a vertex. "share_of_triangles": of one triangle.

    Notes
    -----
    Vertices or triangles are tried in random order, and those whose hole would share a vertex with an earlier one are
    passed over. On a regular mesh about 8 % of the vertices, or of the triangles, find room. Only if more are requested
    do further holes touch others, in the same order; ``applied["holes_touching"]`` counts them. Vertices that lose
    their last triangle are removed.

    Other than `perturb.Holes`, which draws independently, so that holes grow together.

    References
    ----------
    One of the transformations of Boyer et al. 2011, "SHREC 2011: robust feature detection and description benchmark",
    arXiv:1102.4258.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> perturbed = perturb.MicroHoles(amount=0.03)(sphere, np.random.default_rng(0))
    >>> perturbed.applied["holes"], perturbed.applied["holes_touching"]
    (19, 0)
    """

    amount: float = 0.02
    unit: str = "share_of_vertices"

    name: ClassVar[str] = "micro_holes"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("share_of_vertices", "share_of_triangles")}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=1)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `vertices` (k,), the centres, or `triangles` (k,); the last `touching` of them touch others."""
        ring: _Neighbourhoods | np.ndarray
        if self.unit == "share_of_vertices":
            key, candidates, ring = "vertices", np.unique(mesh.faces), _Neighbourhoods(mesh)
        else:
            key, candidates, ring = "triangles", np.arange(len(mesh.faces)), np.asarray(mesh.faces)
        count = round(self.amount * len(candidates))
        require_enough(self, candidates, count, key)
        order = rng.permutation(candidates)
        apart = _choose_apart(order, ring, count, len(mesh.vertices))
        touching = np.delete(order, apart)[: count - len(apart)]
        return {key: np.concatenate([order[apart], touching]), "touching": len(touching)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        dropped = triangles_of(mesh, parameters)
        rest, counterpart = without_faces(mesh, dropped)
        return self.finish(
            mesh,
            rest,
            counterpart,
            holes=len(parameters["vertices" if "vertices" in parameters else "triangles"]),
            holes_touching=parameters["touching"],
            triangles_removed=int(np.count_nonzero(dropped)),
            vertices_removed=int(np.count_nonzero(counterpart < 0)),
        )


class _Neighbourhoods:
    """For each vertex, itself and its neighbours: the vertices of the hole around it."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        graph = edge_graph(mesh).tocsr()
        self._start, self._neighbours = graph.indptr, graph.indices

    def __getitem__(self, vertex: int) -> np.ndarray:
        return np.append(self._neighbours[self._start[vertex] : self._start[vertex + 1]], vertex)


def _choose_apart(order: np.ndarray, ring: _Neighbourhoods | np.ndarray, count: int, n_vertices: int) -> list[int]:
    """Return positions in `order`, up to `count`, of holes that share no vertex with those chosen before."""
    occupied = np.zeros(n_vertices, dtype=bool)
    chosen: list[int] = []
    for position, candidate in enumerate(order.tolist()):
        if len(chosen) == count:
            break
        corners = ring[candidate]
        if not occupied[corners].any():
            occupied[corners] = True
            chosen.append(position)
    return chosen
