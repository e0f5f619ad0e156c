"""Changes of the topology: holes, and short circuits."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import trimesh
from scipy.sparse.csgraph import connected_components

from perturb.perturbation import (
    Parameters,
    Perturbation,
    PerturbationError,
    Perturbed,
    edge_graph,
    without_faces,
)


@dataclass(frozen=True)
class Holes(Perturbation):
    """Triangles are removed, and with them the vertices that lose their last one.

    amount, unit : how many triangles (triangles, Table 2's reading), which share of them (share_of_triangles,
        Figure 12), or of how many vertices all triangles (one_rings, another reading of section 6.5).

    Sampling is uniform and without replacement. 1-rings may overlap.
    Source: paper section 6.5.
    """

    amount: float = 58
    unit: str = "triangles"

    name: ClassVar[str] = "holes"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("triangles", "share_of_triangles", "one_rings")}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.unit == "share_of_triangles":
            self._check_number("amount", most=1)
        else:
            self._check_number("amount", whole=True)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """`triangles` (k,): the faces to remove; or `vertices` (k,): the centres of the 1-rings to remove."""
        if self.unit == "one_rings":
            return {"vertices": self._draw(np.unique(mesh.faces), int(self.amount), rng, "vertices with faces")}
        n_faces = len(mesh.faces)
        count = round(self.amount * n_faces) if self.unit == "share_of_triangles" else int(self.amount)
        return {"triangles": self._draw(np.arange(n_faces), count, rng, "triangles")}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        if "vertices" in parameters:
            dropped = np.isin(mesh.faces, parameters["vertices"]).any(axis=1)
        else:
            dropped = np.zeros(len(mesh.faces), dtype=bool)
            dropped[parameters["triangles"]] = True
        rest, counterpart = without_faces(mesh, dropped)
        return self._finish(
            mesh,
            rest,
            counterpart,
            triangles_removed=int(np.count_nonzero(dropped)),
            vertices_removed=int(np.count_nonzero(counterpart < 0)),
        )

    def _draw(self, pool: np.ndarray, count: int, rng: np.random.Generator, what: str) -> np.ndarray:
        if count > len(pool):
            raise PerturbationError(f"holes: {count} {self.unit} are asked for; the mesh has {len(pool)} {what}")
        return rng.choice(pool, count, replace=False)


@dataclass(frozen=True)
class ShortCircuits(Perturbation):
    """Places near in space and far along the surface are joined by tubes, or by strips.

    amount : the number of tubes.
    near : the largest straight distance between a tube's ends, a share of the bounding-box diagonal.
    far : the smallest distance between them along the edges, a share of the diagonal, at least DETOUR * near.
        Distances along edges overestimate those on the surface. Ends on two components count as far.
    bridge : tube, three quadrilaterals; or strip, the shortest of them only, which is thinner for heat.

    The ends are a random vertex and a random one of those near in space and far along the surface. A tube
    takes at each end the triangle nearest to the other end, removes both, and joins their outlines by six
    triangles, wound as their neighbours are: what was edge-manifold, watertight and consistently oriented
    stays so, and every tube lowers the Euler number by 2. A strip leaves open what the other sides would have
    closed: the surface stays edge-manifold and gets a boundary, and the Euler number falls by 3. No two tubes
    share a vertex. Tubes may pass through the inside of the shape, as some do in the paper's Figure 11, and are
    not checked for crossing anything.

    Where fewer than `amount` tubes can be placed from SOURCES random vertices, `near` is widened in STEPS
    equal ratios up to far / DETOUR, where SOURCES_AT_LAST are looked at; `applied` holds the limit really used.
    Should that not be enough either (a flat or nearly spherical shape has no such places), PerturbationError with
    the number of tubes found.
    Source: paper section 6.5, which says how pairs are chosen, but not how near, how far or how joined.
    """

    amount: float = 10
    unit: str = "count"
    near: float = 0.05
    far: float = 0.2
    bridge: str = "tube"

    name: ClassVar[str] = "short_circuits"
    version: ClassVar[int] = 2
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("count",), "bridge": ("tube", "strip")}

    SOURCES: ClassVar[int] = 500
    SOURCES_AT_LAST: ClassVar[int] = 2000
    DETOUR: ClassVar[float] = 1.5  # just below that around half a round limb, pi / 2; a flat surface has 1
    STEPS: ClassVar[int] = 5

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_number("amount", whole=True)
        self._check_number("near", positive=True)
        self._check_number("far", positive=True)
        if self.far < self.DETOUR * self.near:
            raise PerturbationError(
                f"short_circuits: far is {self.far:g} and near is {self.near:g}; far must be at least "
                f"{self.DETOUR:g} times near, or the ends are hardly nearer in space than along the surface"
            )

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """`vertices` (k, 2): the ends; `triangles` (k, 2): the faces there; `near`: the limit really used."""
        count = int(self.amount)
        placed = _Tubes(mesh)
        near_used = self.near
        pairs = self._pairs(mesh, rng) if count > 0 else ()
        for near, start, end in pairs:
            if placed.add(start, end):
                near_used = near
                if len(placed.ends) == count:
                    break
        if len(placed.ends) < count:
            raise PerturbationError(
                f"short_circuits: {count} tubes are asked for and {len(placed.ends)} found, with ends within "
                f"{self.far / self.DETOUR:g} bounding-box diagonals in space and beyond {self.far:g} along the edges; "
                "lower amount or far"
            )
        return {
            "vertices": np.array(placed.ends, dtype=np.int64).reshape(-1, 2),
            "triangles": np.array(placed.triangles, dtype=np.int64).reshape(-1, 2),
            "near": near_used,
        }

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        start, end = vertices[parameters["vertices"]].transpose(1, 0, 2)
        length = np.linalg.norm(start - end, axis=1)
        bridge = _tube if self.bridge == "tube" else _strip
        tubes = [bridge(vertices, faces[a], faces[b]) for a, b in parameters["triangles"]]
        kept = np.delete(faces, parameters["triangles"].ravel(), axis=0)
        joined = trimesh.Trimesh(vertices.copy(), np.concatenate([kept, *tubes]), process=False)
        _, component = connected_components(edge_graph(mesh), directed=False)
        apart = np.diff(component[parameters["vertices"]], axis=1)
        return self._finish(
            mesh,
            joined,
            np.arange(len(vertices)),
            tubes=len(tubes),
            tubes_between_components=int(np.count_nonzero(apart)),
            near_used=float(parameters["near"]),
            longest_tube=float(length.max(initial=0.0)),
            triangles_removed=2 * len(tubes),
            triangles_added=sum(map(len, tubes)),
        )

    def _pairs(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Iterator[tuple[float, int, int]]:
        """Yield (near, start, end): random vertices, and ends far along the edges, with `near` widening."""
        # Here, so that importing the package does not wait for numba.
        from perturb.places import near_but_far

        vertices, graph = np.asarray(mesh.vertices), edge_graph(mesh).tocsr()
        diagonal = np.linalg.norm(mesh.extents)
        sources = rng.permutation(np.unique(mesh.faces))
        limits = np.geomspace(self.near, self.far / self.DETOUR, self.STEPS + 1)
        for near in limits:
            tried = sources[: self.SOURCES if near < limits[-1] else self.SOURCES_AT_LAST]
            done = []
            for i, ends in near_but_far(vertices, graph, tried, near * diagonal, self.far * diagonal):
                done.append(i)
                yield near, sources[i], rng.choice(ends)
            sources = np.delete(sources, done)


class _Tubes:
    """Tubes placed so far on a mesh: their ends (vertices), and the triangles there."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.ends: list[tuple[int, int]] = []
        self.triangles: list[tuple[int, int]] = []
        self._faces = np.asarray(mesh.faces)
        self._vertices = np.asarray(mesh.vertices)
        self._faces_at = mesh.faces_sparse.tocsr()
        self._taken = np.zeros(len(mesh.vertices), dtype=bool)

    def add(self, start: int, end: int) -> bool:
        """Place a tube between two vertices; False if it would touch another one or an edge that is there."""
        a, b = self._triangle_towards(start, end), self._triangle_towards(end, start)
        corners = np.r_[self._faces[a], self._faces[b]]
        if self._taken[corners].any() or len(np.unique(corners)) < 6:
            return False
        around = np.concatenate([self._incident(corner) for corner in self._faces[a]])
        if np.isin(self._faces[b], self._faces[around]).any():
            return False
        self._taken[corners] = True
        self.ends.append((start, end))
        self.triangles.append((a, b))
        return True

    def _triangle_towards(self, vertex: int, other: int) -> int:
        """The triangle at `vertex` whose centroid is nearest to `other`."""
        incident = self._incident(vertex)
        centroids = self._vertices[self._faces[incident]].mean(axis=1)
        return int(incident[np.linalg.norm(centroids - self._vertices[other], axis=1).argmin()])

    def _incident(self, vertex: int) -> np.ndarray:
        """(k,) the triangles at `vertex`, ascending."""
        return np.sort(self._faces_at.indices[slice(*self._faces_at.indptr[vertex : vertex + 2])])


def _tube(vertices: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(6, 3) triangles from the outline of triangle a (3,) to that of b, in the place of both.

    They run along each outline as the removed triangle did, so neighbours keep their winding. Of the three
    ways to pair the corners, the one with the shortest sides.
    """
    turns = [np.roll(b[::-1], k) for k in range(3)]
    b = min(turns, key=lambda turn: np.sum((vertices[a] - vertices[turn]) ** 2))
    a_next, b_next = np.roll(a, -1), np.roll(b, -1)
    return np.concatenate([np.stack([a, a_next, b_next], axis=1), np.stack([a, b_next, b], axis=1)])


def _strip(vertices: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(2, 3) triangles: the side of the tube from a (3,) to b (3,) whose two ends are nearest to each other."""
    tube = _tube(vertices, a, b)
    squared = np.sum((vertices[tube[:3, 0]] - vertices[tube[3:, 2]]) ** 2, axis=1)
    side = np.argmin(squared + np.roll(squared, -1))
    return tube[[side, side + 3]]
