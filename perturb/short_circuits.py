"""Short circuits: bridges between parts that are near in space but far apart along the surface."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb.meshes import LENGTHS, as_trimesh, edge_graph, size_exponent
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class ShortCircuits(Perturbation):
    """Join vertices that are near in space but far apart along the surface by tubes or strips.

    Parameters
    ----------
    amount : float
        The number of tubes.
    unit : str
        "count".
    near : float
        The largest distance in space between the ends of a tube, as a share of the bounding-box diagonal.
    far : float
        The smallest distance between them along the edges, as a share of the diagonal, at least
        ``MIN_DETOUR * near``. Ends on two components count as far apart.
    bridge : str
        "tube": three quadrilaterals. "strip": only the shortest of the three, which conducts less heat.

    Notes
    -----
    The ends of a tube are a random vertex and a random one of those near in space and far along the surface. At each
    end the triangle nearest to the other end is removed, and the outlines of the two triangles are joined by six
    triangles, oriented like their neighbours: a surface that was edge-manifold, watertight and consistently oriented
    remains so, and every tube lowers the Euler characteristic by 2. A strip leaves open what the other two sides would
    close: the surface remains edge-manifold but gains a boundary, and the Euler characteristic falls by 3. No vertex
    loses its last face, and no two tubes share a vertex. Tubes may pass through the interior of the shape, as some do
    in the paper's Figure 11, and are not checked for intersections.

    If fewer than `amount` tubes can be placed from SOURCES_PER_STEP random vertices, `near` is widened in
    WIDENING_STEPS equal ratios up to ``far / MIN_DETOUR``, where SOURCES_IN_LAST_STEP vertices are tried;
    `Perturbed.applied` contains the limit that was used. If that does not suffice either (a flat or nearly spherical
    shape has no such vertices), a PerturbationError reports the number of tubes found. Distances along the edges
    overestimate those along the surface.

    References
    ----------
    Paper, section 6.5, which describes how the ends are chosen, but not how near, how far, or how they are joined.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere()
    >>> pair = trimesh.util.concatenate(ball, ball.copy().apply_translation([2.1, 0, 0]))
    >>> joined = perturb.ShortCircuits(amount=1)(pair, np.random.default_rng(0))
    >>> joined.applied["components_before"], joined.applied["components_after"]
    (2, 1)
    >>> pair.euler_number, joined.mesh.euler_number, joined.mesh.is_watertight
    (4, 2, True)
    """

    amount: float = 10
    unit: str = "count"
    near: float = 0.05
    far: float = 0.2
    bridge: str = "tube"

    name: ClassVar[str] = "short_circuits"
    version: ClassVar[int] = 2
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("count",), "bridge": ("tube", "strip")}

    SOURCES_PER_STEP: ClassVar[int] = 500
    SOURCES_IN_LAST_STEP: ClassVar[int] = 2000
    MIN_DETOUR: ClassVar[float] = 1.5  # just below that around half a round limb, pi / 2; on a flat surface it is 1
    WIDENING_STEPS: ClassVar[int] = 5

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", whole=True)
        self.check_number("near", positive=True)
        self.check_number("far", positive=True)
        if self.far < self.MIN_DETOUR * self.near:
            raise PerturbationError(
                f"short_circuits: far is {self.far:g} and near is {self.near:g}; far must be at least "
                f"{self.MIN_DETOUR:g} times near, or the ends are hardly nearer in space than along the surface"
            )

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `vertices` (k, 2), the ends, and `triangles` (k, 2), the faces there; `near` is the limit used."""
        count = int(self.amount)
        placement = _Placement(mesh, self.bridge)
        near_used = self.near
        candidates = self._candidates(mesh, rng) if count > 0 else ()
        for near, start, end in candidates:
            if placement.try_add(start, end):
                near_used = near
                if len(placement.ends) == count:
                    break
        if len(placement.ends) < count:
            between = ", where a strip leaves no vertex without a face" if self.bridge == "strip" else ""
            raise PerturbationError(
                f"short_circuits: {count} tubes were requested, but only {len(placement.ends)} were found with ends "
                f"within {self.far / self.MIN_DETOUR:g} bounding-box diagonals in space and beyond {self.far:g} along "
                f"the edges{between}; lower amount or far"
            )
        return {
            "vertices": np.array(placement.ends, dtype=np.int64).reshape(-1, 2),
            "triangles": np.array(placement.triangles, dtype=np.int64).reshape(-1, 2),
            "near": near_used,
        }

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        exponent = size_exponent(mesh)
        vertices, faces = np.ldexp(np.asarray(mesh.vertices), -exponent), np.asarray(mesh.faces)
        start, end = vertices[parameters["vertices"]].transpose(1, 0, 2)
        length = np.linalg.norm(start - end, axis=1)
        bridge_faces = _BRIDGE_FACES[self.bridge]
        bridges = [bridge_faces(vertices, faces[a], faces[b]) for a, b in parameters["triangles"]]
        kept = np.delete(faces, parameters["triangles"].ravel(), axis=0)
        bridged = np.concatenate([kept, *bridges])
        if len(np.unique(bridged)) < len(np.unique(faces)):
            raise PerturbationError(
                "short_circuits: a strip would leave a vertex without a face; draw the parameters with the same bridge"
            )
        return self.finish(
            mesh,
            as_trimesh(mesh.vertices, bridged),
            np.arange(len(vertices)),
            tubes=len(bridges),
            tubes_between_components=_count_between_components(mesh, parameters["vertices"]),
            near_used=float(parameters["near"]),
            longest_tube=float(np.ldexp(length.max(initial=0.0), exponent)),
            triangles_removed=2 * len(bridges),
            triangles_added=sum(map(len, bridges)),
        )

    def _candidates(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Iterator[tuple[float, int, int]]:
        """Yield (near, start, end): random vertices and ends far along the edges, with `near` widening."""
        from perturb._proximity import search_near_but_far  # imported here, because it loads numba

        exponent = size_exponent(mesh)
        vertices, graph = np.ldexp(np.asarray(mesh.vertices), -exponent), edge_graph(mesh).tocsr()
        graph.data = np.ldexp(graph.data, -exponent)
        diagonal = np.ldexp(LENGTHS["bounding_box_diagonal"](mesh), -exponent)
        sources = rng.permutation(np.unique(mesh.faces))
        limits = np.geomspace(self.near, self.far / self.MIN_DETOUR, self.WIDENING_STEPS + 1).tolist()
        for near in limits:
            tried = sources[: self.SOURCES_PER_STEP if near < limits[-1] else self.SOURCES_IN_LAST_STEP]
            used = []
            for i, ends in search_near_but_far(vertices, graph, tried, near * diagonal, self.far * diagonal):
                used.append(i)
                yield near, sources[i], rng.choice(ends)
            sources = np.delete(sources, used)


class _Placement:
    """The tubes placed so far on a mesh: their ends (vertices), and the triangles there."""

    def __init__(self, mesh: trimesh.Trimesh, bridge: str = "tube") -> None:
        self._bridge_faces = _BRIDGE_FACES[bridge]
        self.ends: list[tuple[int, int]] = []
        self.triangles: list[tuple[int, int]] = []
        self._faces = np.asarray(mesh.faces)
        self._vertices = np.ldexp(np.asarray(mesh.vertices), -size_exponent(mesh))
        self._faces_at = mesh.faces_sparse.tocsr()
        self._occupied = np.zeros(len(mesh.vertices), dtype=bool)

    def try_add(self, start: int, end: int) -> bool:
        """Place a tube between two vertices; return False if it would touch another tube or an existing edge.

        Also if a vertex would lose its last face: one that only a removed triangle has, and a strip does not use.
        """
        a, b = self._triangle_towards(start, end), self._triangle_towards(end, start)
        corners = np.r_[self._faces[a], self._faces[b]]
        if self._occupied[corners].any() or len(np.unique(corners)) < 6:
            return False
        around = np.concatenate([self._incident_faces(corner) for corner in self._faces[a]])
        if np.isin(self._faces[b], self._faces[around]).any():
            return False
        off_bridge = np.setdiff1d(corners, self._bridge_faces(self._vertices, self._faces[a], self._faces[b]))
        if any(len(self._incident_faces(corner)) < 2 for corner in off_bridge):
            return False
        self._occupied[corners] = True
        self.ends.append((start, end))
        self.triangles.append((a, b))
        return True

    def _triangle_towards(self, vertex: int, other: int) -> int:
        """Return the triangle at `vertex` whose centroid is nearest to `other`."""
        incident = self._incident_faces(vertex)
        centroids = self._vertices[self._faces[incident]].mean(axis=1)
        return int(incident[np.linalg.norm(centroids - self._vertices[other], axis=1).argmin()])

    def _incident_faces(self, vertex: int) -> np.ndarray:
        """(k,) the triangles at `vertex`, ascending."""
        return np.sort(self._faces_at.indices[slice(*self._faces_at.indptr[vertex : vertex + 2])])


def _tube_faces(vertices: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(6, 3) triangles between the outlines of the triangles a (3,) and b (3,), which they replace.

    They traverse each outline as the removed triangle did, so they are oriented like the neighbours. Of the three ways
    to pair the corners, the one with the shortest sides is taken.
    """
    rotations = [np.roll(b[::-1], k) for k in range(3)]
    b = min(rotations, key=lambda rotated: np.sum((vertices[a] - vertices[rotated]) ** 2))
    a_next, b_next = np.roll(a, -1), np.roll(b, -1)
    return np.concatenate([np.stack([a, a_next, b_next], axis=1), np.stack([a, b_next, b], axis=1)])


def _strip_faces(vertices: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(2, 3) triangles: the side of the tube from a (3,) to b (3,) whose two rails are shortest."""
    tube = _tube_faces(vertices, a, b)
    squared = np.sum((vertices[tube[:3, 0]] - vertices[tube[3:, 2]]) ** 2, axis=1)
    side = np.argmin(squared + np.roll(squared, -1))
    return tube[[side, side + 3]]


_BRIDGE_FACES = {"tube": _tube_faces, "strip": _strip_faces}


def _count_between_components(mesh: trimesh.Trimesh, ends: np.ndarray) -> int:
    """Return how many pairs of vertices (k, 2) are on two different components."""
    from scipy.sparse.csgraph import connected_components

    _, component = connected_components(edge_graph(mesh), directed=False)
    return int(np.count_nonzero(np.diff(component[ends], axis=1)))
