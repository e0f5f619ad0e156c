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


_ROUNDING = 1e-9  # relative; 1.5 times 0.1 is more than 0.15


@dataclass(frozen=True)
class Welding(Perturbation):
    """Merge vertices that are near in space but far apart along the surface, as where parts touch. Deterministic.

    Parameters
    ----------
    amount : float
        How many vertices are merged with another one, or how near they must be, depending on `unit`.
    unit : str
        "share_of_vertices": 0 to 1, ``round(amount * n / 2)`` pairs of the n vertices, at least one.
        "bounding_box_diagonal" or "mean_edge_length": all pairs whose distance in space is at most that length.
    far : float
        The smallest distance between the two along the edges, as a share of the bounding-box diagonal. It must be at
        least MIN_DETOUR times the distance in space. Vertices on two components count as far apart.
    where : str
        "any": all such vertices. "external": only across a gap, where each of the two lies on the side to which the
        normal of the other points. "internal": only through the body, where each lies on the opposite side.

    Notes
    -----
    For each vertex the nearest one that qualifies is found. These pairs are merged in ascending order of their
    distances, each vertex at most once, at their midpoints. Parts are thus glued along an area, where the surface is no
    manifold: edges have up to four faces, and faces of the two parts may lie on each other. The merged vertex is the
    counterpart of both: ``applied["counterpart_by"]`` is "merging". Normals are those of `perturb.vertex_normals`, and
    must point outwards unless `where` is "any".

    If there are fewer pairs than requested, or none, a PerturbationError reports it: the shape has no parts that are
    near each other.

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
    >>> glued = perturb.Welding(amount=0.05, unit="bounding_box_diagonal")(pair, np.random.default_rng(0))
    >>> glued.applied["components_before"], glued.applied["components_after"]
    (2, 1)
    """

    amount: float = 0.01
    unit: str = "share_of_vertices"
    far: float = 0.15
    where: str = "any"

    name: ClassVar[str] = "welding"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {
        "unit": ("share_of_vertices", *LENGTHS),
        "where": ("any", "external", "internal"),
    }

    MIN_DETOUR: ClassVar[float] = 1.5  # just below that around half a round limb, pi / 2; on a flat surface it is 1

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("far", positive=True)
        if self.unit == "share_of_vertices":
            self.check_number("amount", maximum=1)
        if self.unit == "bounding_box_diagonal":
            self._require_detour(self.amount)

    def _require_detour(self, near: float) -> None:
        """Raise PerturbationError if `far` is not far enough for a largest distance in space, in diagonals."""
        if self.far < self.MIN_DETOUR * near * (1 - _ROUNDING):
            raise PerturbationError(
                f"welding: far is {self.far:g} and amount {near:g} bounding-box diagonals; far must be at least "
                f"{self.MIN_DETOUR:g} times amount, or the vertices are hardly nearer in space than along the surface"
            )

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        exponent = size_exponent(mesh)
        vertices, faces = np.ldexp(np.asarray(mesh.vertices), -exponent), np.asarray(mesh.faces)
        kept, merged = np.empty((2, 0), dtype=np.int64) if self.amount == 0 else self._pairs(mesh, vertices)
        gaps = np.linalg.norm(vertices[kept] - vertices[merged], axis=1)
        into = np.arange(len(vertices))
        into[merged] = kept
        vertices[kept] = (vertices[kept] + vertices[merged]) / 2
        result, counterpart, _ = merge_vertices(np.ldexp(vertices, exponent), faces, into)
        return self.finish(
            mesh,
            result,
            counterpart,
            pairs_merged=len(merged),
            largest_gap=float(np.ldexp(gaps.max(initial=0.0), exponent)),
            counterpart_by="merging",
        )

    def _pairs(self, mesh: trimesh.Trimesh, vertices: np.ndarray) -> np.ndarray:
        """(2, k) the vertices that remain and those merged into them; PerturbationError if there are too few."""
        by_share = self.unit == "share_of_vertices"
        diagonal = float(np.ldexp(LENGTHS["bounding_box_diagonal"](mesh), -size_exponent(mesh)))
        near = self.far / self.MIN_DETOUR
        if not by_share:
            near = float(np.ldexp(self.amount * LENGTHS[self.unit](mesh), -size_exponent(mesh))) / diagonal
            self._require_detour(near)
        first, second, distance = self._nearest_ends(mesh, vertices, near * diagonal, self.far * diagonal)
        pairs = _disjoint(first, second, distance, len(vertices))
        wanted = max(1, round(self.amount * len(vertices) / 2)) if by_share else max(1, pairs.shape[1])
        if pairs.shape[1] < wanted:
            connections = "" if self.where == "any" else f" with {self.where} connections"
            raise PerturbationError(
                f"welding: {wanted} or more pairs of vertices were requested, but only {pairs.shape[1]}{connections} "
                f"are within {near:.3g} bounding-box diagonals in space and beyond {self.far:g} along the edges; "
                f"{'lower' if by_share else 'raise'} amount or lower far"
            )
        return pairs[:, :wanted]

    def _nearest_ends(
        self, mesh: trimesh.Trimesh, vertices: np.ndarray, near: float, far: float
    ) -> tuple[np.ndarray, ...]:
        """Return the vertices (k,) with others that qualify, the nearest of these (k,), and its distance (k,)."""
        from perturb._proximity import search_near_but_far  # imported here, because it loads numba

        graph = edge_graph(mesh).tocsr()
        graph.data = np.ldexp(graph.data, -size_exponent(mesh))
        normals = vertex_normals(mesh)
        sources = np.unique(mesh.faces)
        found = []
        for i, ends in search_near_but_far(vertices, graph, sources, near, far):
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


def _disjoint(first: np.ndarray, second: np.ndarray, distance: np.ndarray, n_vertices: int) -> np.ndarray:
    """(2, p) pairs of those (k,) given, in ascending order of distance, without vertices of earlier pairs."""
    free = np.ones(n_vertices, dtype=bool)
    chosen = []
    for i in np.lexsort([second, first, distance]).tolist():
        if free[first[i]] and free[second[i]]:
            free[[first[i], second[i]]] = False
            chosen.append(i)
    return np.sort(np.stack([first[chosen], second[chosen]]), axis=0)
