"""Slivers: needles and caps, triangles that are far from equilateral."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._drawing import draw
from perturb._normals import is_degenerate
from perturb.meshes import as_trimesh, size_exponent
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh

_HIGHEST_CAP = 1 / 3  # of the height of the triangle, so that the two others do not become flat


@dataclass(frozen=True)
class Slivers(Perturbation):
    """Insert vertices such that needle-like or flat triangles appear. The surface remains exactly the same.

    Parameters
    ----------
    amount : float
        The share of edges or of faces in which a vertex is inserted, 0 to 1.
    unit : str
        "share_of_edges": needles. A vertex is inserted on an edge, near one of its ends, and the faces of the edge are
        divided. "share_of_faces": caps. A vertex is inserted in a face, near the middle of its longest edge.
    aspect : float
        From 2 to 1e6. For needles, the length of the edge relative to that of its short piece; for caps, the length of
        the edge relative to the height of the flat triangle on it.

    Notes
    -----
    Edges of length 0 and faces without area are never drawn. A face of which several edges are drawn is divided into up
    to four. Original vertices keep their indices, and new ones follow; faces that are divided are replaced at the end.
    New vertices are on the surface within the rounding of coordinates.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> perturbed = perturb.Slivers(amount=0.1)(sphere, np.random.default_rng(0))
    >>> perturbed.applied["vertices_added"], perturbed.applied["faces_added"]
    (192, 384)
    >>> bool(np.isclose(perturbed.mesh.area, sphere.area, rtol=1e-12))
    True
    """

    amount: float = 0.05
    unit: str = "share_of_edges"
    aspect: float = 100.0

    name: ClassVar[str] = "slivers"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("share_of_edges", "share_of_faces")}

    MAX_ASPECT: ClassVar[float] = 1e6

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=1)
        self.check_number("aspect", maximum=self.MAX_ASPECT)
        if self.aspect < 2:
            raise PerturbationError(f"slivers: aspect is {self.aspect:g}; it must be at least 2")

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `edges` (k, 2), in each the vertex first near which one is inserted; or `faces` (k,)."""
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        if self.unit == "share_of_faces":
            proper = np.flatnonzero(~is_degenerate(vertices, faces))
            return {"faces": draw(self, proper, round(self.amount * len(proper)), rng, "faces with an area")}
        edges = np.asarray(mesh.edges_unique)
        extended = np.flatnonzero((vertices[edges[:, 0]] != vertices[edges[:, 1]]).any(axis=1))
        drawn = edges[draw(self, extended, round(self.amount * len(extended)), rng, "edges with a length")]
        reverse = rng.random(len(drawn)) < 0.5
        return {"edges": np.where(reverse[:, None], drawn[:, ::-1], drawn)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        if "edges" in parameters:
            edges = parameters["edges"]
            start, end = vertices[edges[:, 0]], vertices[edges[:, 1]]
            inserted = start + (end - start) / self.aspect
            lost = (inserted == start).all(axis=1)
            divided = _divide_at_edges(faces, edges, len(vertices))
        else:
            inserted, divided = self._caps(mesh, parameters["faces"])
            lost = is_degenerate(np.concatenate([vertices, inserted]), divided[: len(inserted)])
            divided = np.concatenate([np.delete(faces, parameters["faces"], axis=0), divided])
        if lost.any():
            raise PerturbationError(
                f"slivers: an aspect of {self.aspect:g} is lost in the rounding of coordinates of up to "
                f"{np.abs(vertices).max():.3g}; choose a smaller aspect, or move the mesh to the origin"
            )
        return self.finish(
            mesh,
            as_trimesh(np.concatenate([vertices, inserted]), divided),
            np.arange(len(vertices)),
            vertices_added=len(inserted),
            faces_added=len(divided) - len(faces),
        )

    def _caps(self, mesh: trimesh.Trimesh, drawn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the vertices (k, 3) to insert in the faces (k,), and the faces (3 k, 3) instead, flat ones first."""
        vertices = np.ldexp(np.asarray(mesh.vertices), -size_exponent(mesh))
        faces = np.asarray(mesh.faces)[drawn]
        lengths = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, -1, axis=1)], axis=2)
        a, b, c = _rotated(faces, lengths.argmax(axis=1)).T
        base, middle = lengths.max(axis=1), (vertices[a] + vertices[b]) / 2
        height = np.linalg.norm(np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a]), axis=1) / base
        raised = np.minimum(base / self.aspect / height, _HIGHEST_CAP)
        inserted = np.ldexp(middle + raised[:, None] * (vertices[c] - middle), size_exponent(mesh))
        new = len(vertices) + np.arange(len(drawn))
        return inserted, _stacked([(a, b, new), (b, c, new), (c, a, new)])


def _divide_at_edges(faces: np.ndarray, edges: np.ndarray, n_vertices: int) -> np.ndarray:
    """(p, 3) the faces, divided where a vertex is inserted on one of their edges.

    The vertex on ``edges[i]`` is ``n_vertices + i``. In a face a, b, c the new vertices on the edges from a, b and c
    are p, q and r.
    """
    key = edges.min(axis=1) * n_vertices + edges.max(axis=1)
    order = np.argsort(key)
    following = np.roll(faces, -1, axis=1)
    wanted = np.minimum(faces, following) * n_vertices + np.maximum(faces, following)
    position = np.minimum(np.searchsorted(key, wanted, sorter=order), max(len(key) - 1, 0))
    found = key[order[position]] == wanted if len(key) else np.zeros(faces.shape, dtype=bool)
    inserted = np.where(found, n_vertices + order[position], -1) if len(key) else np.full(faces.shape, -1)
    n_found = found.sum(axis=1)
    once, twice, thrice = (n_found == k for k in (1, 2, 3))
    first = found[once].argmax(axis=1)
    (a, b, c), (p, _, _) = _rotated(faces[once], first).T, _rotated(inserted[once], first).T
    halves = _stacked([(a, p, c), (p, b, c)])
    after_intact = ((~found[twice]).argmax(axis=1) + 1) % 3
    (a, b, c), (p, q, _) = _rotated(faces[twice], after_intact).T, _rotated(inserted[twice], after_intact).T
    thirds = _stacked([(p, b, q), (a, p, q), (a, q, c)])
    (a, b, c), (p, q, r) = faces[thrice].T, inserted[thrice].T
    quarters = _stacked([(a, p, r), (p, b, q), (q, c, r), (p, q, r)])
    return np.concatenate([faces[n_found == 0], halves, thirds, quarters])


def _rotated(rows: np.ndarray, first: np.ndarray) -> np.ndarray:
    """(k, 3) the rows, each rotated so that its column `first` (k,) comes first."""
    return np.take_along_axis(rows, (first[:, None] + np.arange(3)) % 3, axis=1)


def _stacked(triangles: list[tuple[np.ndarray, ...]]) -> np.ndarray:
    """(j k, 3) faces from j triples of corners (k,) each."""
    return np.concatenate([np.stack(corners, axis=1) for corners in triangles])
