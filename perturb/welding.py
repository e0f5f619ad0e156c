"""Welding: parts that are near each other are glued together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._merging import merge_vertices
from perturb.meshes import LENGTHS, edge_graph, size_exponent, vertex_normals
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Welding(Perturbation):
    """Merge vertices that are near in space but far apart along the surface, as where parts touch. Deterministic.

    Parameters
    ----------
    amount : float
        The largest distance in space between two vertices that are merged, in `unit`.
    unit : str
        "bounding_box_diagonal" or "mean_edge_length".
    ratio : float
        How far apart they must be along the edges, as a multiple of `amount`; at least MIN_RATIO. Vertices on two
        components count as far apart.
    where : str
        "external": only across a gap, where each of the two vertices lies on the side to which the normal of the other
        points. "internal": only through the body, where each lies on the opposite side. "any": both, and all others.

    Notes
    -----
    For each vertex the nearest one that qualifies is found. These pairs are merged in ascending order of their
    distances, each vertex at most once, at their midpoints. So the parts are glued along an area, and where they are the
    surface is no manifold: edges have up to four faces, and faces of the two parts may lie on each other. The merged
    vertex is the counterpart of both: ``applied["counterpart_by"]`` is "merging". Normals are those of
    `perturb.vertex_normals`; for ``where="external"`` they must point outwards.

    If no two vertices qualify, a PerturbationError reports it: the shape has no parts that near each other.

    References
    ----------
    One of the transformations ("topology") of Boyer et al. 2011, "SHREC 2011: robust feature detection and description
    benchmark", arXiv:1102.4258, which glues touching parts.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere()
    >>> pair = trimesh.util.concatenate(ball, ball.copy().apply_translation([2.1, 0, 0]))
    >>> glued = perturb.Welding(amount=0.05)(pair, np.random.default_rng(0))
    >>> glued.applied["components_before"], glued.applied["components_after"]
    (2, 1)
    """

    amount: float = 0.03
    unit: str = "bounding_box_diagonal"
    ratio: float = 3.0
    where: str = "external"

    name: ClassVar[str] = "welding"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {
        "unit": tuple(LENGTHS),
        "where": ("external", "internal", "any"),
    }

    MIN_RATIO: ClassVar[float] = 1.5  # just below that around half a round limb, pi / 2; on a flat surface it is 1

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("ratio")
        if self.ratio < self.MIN_RATIO:
            raise PerturbationError(f"welding: ratio is {self.ratio:g}; it must be at least {self.MIN_RATIO:g}")

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        exponent = size_exponent(mesh)
        vertices, faces = np.ldexp(np.asarray(mesh.vertices), -exponent), np.asarray(mesh.faces)
        near = float(np.ldexp(self.amount * LENGTHS[self.unit](mesh), -exponent))
        kept, merged, distance = self._pairs(mesh, vertices, near)
        if self.amount > 0 and len(kept) == 0:
            between = "" if self.where == "any" else f" with {self.where} connections"
            raise PerturbationError(
                f"welding: no two vertices{between} are within {self.amount:g} {self.unit} in space and beyond "
                f"{self.ratio:g} times that along the edges; raise the amount or lower the ratio"
            )
        into = np.arange(len(vertices))
        into[merged] = kept
        vertices[kept] = (vertices[kept] + vertices[merged]) / 2
        result, counterpart, n_collapsed = merge_vertices(np.ldexp(vertices, exponent), faces, into)
        return self.finish(
            mesh,
            result,
            counterpart,
            vertices_merged=len(merged),
            largest_gap=float(np.ldexp(distance.max(initial=0.0), exponent)),
            faces_collapsed=n_collapsed,
            counterpart_by="merging",
        )

    def _pairs(self, mesh: trimesh.Trimesh, vertices: np.ndarray, near: float) -> tuple[np.ndarray, ...]:
        """Return the vertices (k,) that remain, those (k,) merged into them, and their distances (k,)."""
        if near == 0:
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
        first, second, distance = self._nearest_ends(mesh, vertices, near)
        free = np.ones(len(vertices), dtype=bool)
        chosen = []
        for i in np.lexsort([second, first, distance]).tolist():
            if free[first[i]] and free[second[i]]:
                free[[first[i], second[i]]] = False
                chosen.append(i)
        pair = np.sort(np.stack([first[chosen], second[chosen]]), axis=0)
        return pair[0], pair[1], distance[chosen]

    def _nearest_ends(self, mesh: trimesh.Trimesh, vertices: np.ndarray, near: float) -> tuple[np.ndarray, ...]:
        """Return the vertices (k,) with others that qualify, the nearest of these (k,), and its distance (k,)."""
        from perturb._proximity import search_near_but_far  # imported here, because it loads numba

        graph = edge_graph(mesh).tocsr()
        graph.data = np.ldexp(graph.data, -size_exponent(mesh))
        normals = vertex_normals(mesh)
        sources = np.unique(mesh.faces)
        found = []
        for i, ends in search_near_but_far(vertices, graph, sources, near, self.ratio * near):
            start = sources[i]
            across = vertices[ends] - vertices[start]
            qualified = self._qualified(across, normals[start], normals[ends])
            if qualified.any():
                distance = np.where(qualified, np.linalg.norm(across, axis=1), np.inf)
                found.append((start, ends[distance.argmin()], distance.min()))
        first, second, distance = np.array(found, dtype=float).reshape(-1, 3).T
        return first.astype(np.int64), second.astype(np.int64), distance

    def _qualified(self, across: np.ndarray, normal: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(k,) bool: whether the vectors (k, 3) from a vertex to others are where they have to be."""
        if self.where == "any":
            return np.ones(len(across), dtype=bool)
        side = 1 if self.where == "external" else -1
        return (side * across @ normal > 0) & (side * (across * normals).sum(axis=1) < 0)
