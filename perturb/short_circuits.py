"""Short circuits: bridges between parts that are near in space but far apart along the surface."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb.meshes import LENGTHS, as_trimesh, edge_graph, size_exponent, vertex_normals
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class ShortCircuits(Perturbation):
    """Join vertices that are near in space but far apart along the surface by tubes, strips or single triangles.

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
        ``MIN_DETOUR * near``. Ends on two components count as far apart. Not used with `ratio`.
    bridge : str
        "tube": three quadrilaterals. "strip": only the shortest of the three, which conducts less heat. "triangle": a
        single triangle, from a side of the first end's triangle to a corner of the other's, which conducts least.
    where : str
        "any". "internal": only where the straight line between the ends enters the body at both of them, against the
        outward normals, as through the inside of a limb. "external": only where it leaves the body at both, as between
        two limbs.
    ratio : float or None
        The smallest distance between the ends along the edges, as a multiple of their distance in space, above 1; it
        replaces `far`.

    Notes
    -----
    The ends of a tube are a random vertex and a random one of those near in space and far along the surface. At each
    end the triangle nearest to the other end is removed, and the outlines of the two triangles are joined by six
    triangles, oriented like their neighbours: a surface that was edge-manifold, watertight and consistently oriented
    remains so, and every tube lowers the Euler characteristic by 2. A strip leaves open what the other two sides would
    close: the surface remains edge-manifold but gains a boundary, and the Euler characteristic falls by 3. A single
    triangle replaces the one at the first end, and touches the other end in a vertex alone, where nothing is removed:
    the surface remains edge-manifold but gains a boundary, and the Euler characteristic falls by 2. No vertex loses its
    last face, and no two tubes share a vertex. Tubes may pass through the interior of the shape, as some do in the
    paper's Figure 11, and are not checked for intersections.

    Which side of the surface is outside is told by its winding and by the sign of the volume that it encloses; on an
    open surface by that of the cones from its centre to its triangles.

    If fewer than `amount` tubes can be placed from SOURCES_PER_STEP random vertices, `near` is widened in
    WIDENING_STEPS equal ratios up to ``far / MIN_DETOUR``, or with `ratio` up to ``MAX_WIDENING * near``, where
    SOURCES_IN_LAST_STEP vertices are tried; `Perturbed.applied` contains the limit that was used. If that does not
    suffice either (a flat or nearly spherical shape has no such vertices), a PerturbationError reports the number of
    tubes found. Distances along the edges overestimate those along the surface.

    References
    ----------
    Paper, section 6.5, which describes how the ends are chosen, but not how near, how far, or how they are joined; it
    mentions "some short circuits which are internal".

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
    where: str = "any"
    ratio: float | None = None

    name: ClassVar[str] = "short_circuits"
    version: ClassVar[int] = 2
    choices: ClassVar[dict[str, tuple[str, ...]]] = {
        "unit": ("count",),
        "bridge": ("tube", "strip", "triangle"),
        "where": ("any", "internal", "external"),
    }
    later_fields: ClassVar[tuple[str, ...]] = ("where", "ratio")

    SOURCES_PER_STEP: ClassVar[int] = 500
    SOURCES_IN_LAST_STEP: ClassVar[int] = 2000
    MIN_DETOUR: ClassVar[float] = 1.5  # just below that around half a round limb, pi / 2; on a flat surface it is 1
    MAX_WIDENING: ClassVar[float] = 4.0
    WIDENING_STEPS: ClassVar[int] = 5

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", whole=True)
        self.check_number("near", positive=True)
        self.check_number("far", positive=True)
        if self.ratio is not None:
            self.check_number("ratio")
            if self.ratio <= 1:
                raise PerturbationError(
                    f"short_circuits: ratio is {self.ratio:g}; it must be above 1, as the straight line is the shortest"
                )
        elif self.far < self.MIN_DETOUR * self.near:
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
            raise PerturbationError(self._too_few(len(placement.ends)))
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
        removed = parameters["triangles"][:, : _ENDS_REMOVED[self.bridge]].ravel()
        kept = np.delete(faces, removed, axis=0)
        bridged = np.concatenate([kept, *bridges])
        if len(np.unique(bridged)) < len(np.unique(faces)):
            raise PerturbationError(
                f"short_circuits: a {self.bridge} would leave a vertex without a face; "
                "draw the parameters with the same bridge"
            )
        return self.finish(
            mesh,
            as_trimesh(mesh.vertices, bridged),
            np.arange(len(vertices)),
            tubes=len(bridges),
            tubes_between_components=_count_between_components(mesh, parameters["vertices"]),
            near_used=float(parameters["near"]),
            longest_tube=float(np.ldexp(length.max(initial=0.0), exponent)),
            triangles_removed=len(removed),
            triangles_added=sum(map(len, bridges)),
        )

    def _too_few(self, found: int) -> str:
        """The message for a mesh on which only so many tubes were found."""
        where = "" if self.where == "any" else f"{self.where} "
        limit = f"beyond {self.far:g} along the edges"
        remedy = "lower amount or far"
        if self.ratio is not None:
            limit, remedy = f"{self.ratio:g} times as far along the edges", "lower amount or ratio, or raise near"
        between = {
            "strip": ", where a strip leaves no vertex without a face",
            "triangle": ", where a triangle leaves no vertex without a face",
        }.get(self.bridge, "")
        return (
            f"short_circuits: {int(self.amount)} {where}tubes were requested, but only {found} were found with ends "
            f"within {self._widest:g} bounding-box diagonals in space and {limit}{between}; {remedy}"
        )

    @property
    def _widest(self) -> float:
        """The largest value to which `near` is widened."""
        return self.far / self.MIN_DETOUR if self.ratio is None else self.MAX_WIDENING * self.near

    def _candidates(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Iterator[tuple[float, int, int]]:
        """Yield (near, start, end): random vertices and ends far along the edges, with `near` widening."""
        from perturb._proximity import search_detours, search_near_but_far  # imported here, because it loads numba

        exponent = size_exponent(mesh)
        vertices, graph = np.ldexp(np.asarray(mesh.vertices), -exponent), edge_graph(mesh).tocsr()
        graph.data = np.ldexp(graph.data, -exponent)
        diagonal = np.ldexp(LENGTHS["bounding_box_diagonal"](mesh), -exponent)
        is_suitable = self._suitability(mesh)
        sources = rng.permutation(np.unique(mesh.faces))
        limits = np.geomspace(self.near, self._widest, self.WIDENING_STEPS + 1).tolist()
        for near in limits:
            tried = sources[: self.SOURCES_PER_STEP if near < limits[-1] else self.SOURCES_IN_LAST_STEP]
            used = []
            if self.ratio is None:
                found = search_near_but_far(vertices, graph, tried, near * diagonal, self.far * diagonal)
            else:
                found = search_detours(vertices, graph, tried, near * diagonal, self.ratio)
            for i, ends in found:
                suitable = is_suitable(sources[i], ends)
                if len(suitable) > 0:
                    used.append(i)
                    yield near, sources[i], rng.choice(suitable)
            sources = np.delete(sources, used)

    def _suitability(self, mesh: trimesh.Trimesh) -> Callable[[int, np.ndarray], np.ndarray]:
        """A function: start, ends -> those of the ends that are where `where` says."""
        if self.where == "any":
            return lambda start, ends: ends
        vertices, normals = np.ldexp(np.asarray(mesh.vertices), -size_exponent(mesh)), _outward_normals(mesh)
        sign = 1 if self.where == "external" else -1

        def suitable(start: int, ends: np.ndarray) -> np.ndarray:
            way = vertices[ends] - vertices[start]
            leaves_start = way @ normals[start]
            leaves_ends = -np.einsum("ij,ij->i", way, normals[ends])
            return ends[(sign * leaves_start > 0) & (sign * leaves_ends > 0)]

        return suitable


class _Placement:
    """The tubes placed so far on a mesh: their ends (vertices), and the triangles there."""

    def __init__(self, mesh: trimesh.Trimesh, bridge: str = "tube") -> None:
        self._bridge_faces, self._ends_removed = _BRIDGE_FACES[bridge], _ENDS_REMOVED[bridge]
        self.ends: list[tuple[int, int]] = []
        self.triangles: list[tuple[int, int]] = []
        self._faces = np.asarray(mesh.faces)
        self._vertices = np.ldexp(np.asarray(mesh.vertices), -size_exponent(mesh))
        self._faces_at = mesh.faces_sparse.tocsr()
        self._occupied = np.zeros(len(mesh.vertices), dtype=bool)

    def try_add(self, start: int, end: int) -> bool:
        """Place a tube between two vertices; return False if it would touch another tube or an existing edge.

        Also if a vertex would lose its last face: one that only a removed triangle has, and the bridge does not use.
        """
        a, b = self._triangle_towards(start, end), self._triangle_towards(end, start)
        corners = np.r_[self._faces[a], self._faces[b]]
        if self._occupied[corners].any() or len(np.unique(corners)) < 6:
            return False
        around = np.concatenate([self._incident_faces(corner) for corner in self._faces[a]])
        if np.isin(self._faces[b], self._faces[around]).any():
            return False
        of_removed = corners[: 3 * self._ends_removed]
        off_bridge = np.setdiff1d(of_removed, self._bridge_faces(self._vertices, self._faces[a], self._faces[b]))
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


def _triangle_faces(vertices: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(1, 3) the triangle from a side of a (3,), which it traverses as the removed triangle did, to a corner of b (3,).

    Of the nine, the one with the shortest sides to that corner.
    """
    squared = np.sum((vertices[a][:, None] - vertices[b]) ** 2, axis=2)
    side, corner = np.divmod(np.argmin(squared + np.roll(squared, -1, axis=0)), 3)
    return np.array([[a[side], a[(side + 1) % 3], b[corner]]])


def _outward_normals(mesh: trimesh.Trimesh) -> np.ndarray:
    """(n, 3) the normals of the vertices, turned over if the surface is inside out."""
    vertices = np.ldexp(np.asarray(mesh.vertices), -size_exponent(mesh))
    faces = np.asarray(mesh.faces)
    a, b, c = (vertices - vertices[np.unique(faces)].mean(axis=0))[faces.T]
    volume = np.einsum("ij,ij->", a, np.cross(b, c))
    return vertex_normals(mesh) * (-1.0 if volume < 0 else 1.0)


_BRIDGE_FACES = {"tube": _tube_faces, "strip": _strip_faces, "triangle": _triangle_faces}
_ENDS_REMOVED = {"tube": 2, "strip": 2, "triangle": 1}  # at how many ends the triangle is removed


def _count_between_components(mesh: trimesh.Trimesh, ends: np.ndarray) -> int:
    """Return how many pairs of vertices (k, 2) are on two different components."""
    from scipy.sparse.csgraph import connected_components

    _, component = connected_components(edge_graph(mesh), directed=False)
    return int(np.count_nonzero(np.diff(component[ends], axis=1)))
