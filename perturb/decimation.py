"""Decimation: fewer triangles for the same shape."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._normals import distinct_faces, has_repeated_corner
from perturb._welding import (
    LATTICE_SPACING,
    count_coincident,
    lattice_offsets,
    mesh_with_parts,
    result_with_parts,
    separate_coincident,
    weld,
)
from perturb.meshes import as_trimesh, without_faces
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Decimation(Perturbation):
    """Collapse edges, those of least quadric error first, until a share of the faces remains. Deterministic.

    Parameters
    ----------
    amount : float
        The share of faces to keep, above 0 and at most 1; 1 is the identity. A simplifier may stop early, when it
        allows no further collapse: `Perturbed.applied` contains the share that was actually kept.
    unit : str
        "share_of_faces".
    backend : str
        "fast_simplification", with which the counterpart of a vertex is the vertex into which it was collapsed; or
        "pymeshlab", which does not report its collapses, and with which it is the nearest vertex.
        ``applied["counterpart_by"]`` specifies which.

    Notes
    -----
    Before decimation, triangles with a repeated corner are removed, and of several with the same three vertices, in
    either winding, all but the first: `amount` is a share of the others, and `Perturbed.applied` counts the removed
    ones. Triangles that the collapses folded onto each other (with the same three vertices) are removed, in pairs of
    opposite orientation or down to one; the tip of a fold counts as merged into its base. A component that folds
    completely disappears; `Perturbed.applied` counts these triangles. If fast_simplification pinches a thin part, an
    edge with four triangles may remain; pymeshlab preserves the topology.

    Vertices that coincide remain apart. If pymeshlab then cannot remove any face, as of triangles that share no
    vertices, they are merged, and ``applied["welded_vertices"]`` is the number of vertices that vanished thereby. If
    still no face can be removed, a PerturbationError reports it.

    References
    ----------
    Paper, section 6.6 and Figure 13. The quadric error: Garland and Heckbert 1997, doi:10.1145/258734.258849.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> decimated = perturb.Decimation(amount=0.25)(sphere, np.random.default_rng(0))
    >>> len(sphere.faces), len(decimated.mesh.faces)
    (1280, 320)
    """

    amount: float = 0.5
    unit: str = "share_of_faces"
    backend: str = "fast_simplification"

    name: ClassVar[str] = "decimation"
    neutral: ClassVar[float] = 1.0
    choices: ClassVar[dict[str, tuple[str, ...]]] = {
        "unit": ("share_of_faces",),
        "backend": ("fast_simplification", "pymeshlab"),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=1, positive=True)

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        distinct = distinct_faces(np.asarray(mesh.faces))
        n_target = round(self.amount * len(distinct))
        if n_target == len(mesh.faces):
            return self._finish(mesh, _Decimated(as_trimesh(mesh.vertices, mesh.faces), np.arange(len(mesh.vertices))))
        # In a box of size 1, because the error threshold of fast-simplification is absolute.
        corner, size = mesh.bounds[0], mesh.extents.max()
        vertices, faces = (np.asarray(mesh.vertices) - corner) / size, np.asarray(mesh.faces)[distinct]
        backend = _by_fast_simplification if self.backend == "fast_simplification" else _by_pymeshlab
        decimated = backend(vertices, faces, n_target)
        if len(decimated.mesh.faces) + decimated.n_folded == len(faces):
            raise PerturbationError(
                f"decimation: {n_target} of {len(faces)} faces were requested, but {self.backend} cannot collapse any "
                "edge, for example because each is a boundary or has more than two faces; choose the other backend"
            )
        in_place = as_trimesh(np.asarray(decimated.mesh.vertices) * size + corner, decimated.mesh.faces)
        return self._finish(mesh, replace(decimated, mesh=in_place), distinct)

    def _finish(self, mesh: trimesh.Trimesh, decimated: _Decimated, distinct: np.ndarray | None = None) -> Perturbed:
        by_collapses = self.backend == "fast_simplification"
        n_dropped = 0 if distinct is None else len(mesh.faces) - len(distinct)
        n_degenerate = int(np.count_nonzero(has_repeated_corner(np.asarray(mesh.faces)))) if n_dropped else 0
        return self.finish(
            mesh,
            decimated.mesh,
            decimated.counterpart,
            share_of_faces_kept=len(decimated.mesh.faces) / (len(mesh.faces) - n_dropped),
            folded_triangles_removed=decimated.n_folded,
            degenerate_triangles_removed=n_degenerate,
            repeated_triangles_removed=n_dropped - n_degenerate,
            welded_vertices=decimated.n_welded,
            counterpart_by="collapses" if by_collapses else "nearest_vertex",
        )


@dataclass(frozen=True)
class _Decimated:
    """A decimated mesh, the counterpart of each vertex (n,), and how many triangles folded and vertices were merged."""

    mesh: trimesh.Trimesh
    counterpart: np.ndarray
    n_folded: int = 0
    n_welded: int = 0


def _by_fast_simplification(vertices: np.ndarray, faces: np.ndarray, n_target: int) -> _Decimated:
    """Decimate with fast-simplification; counterparts follow from its collapses."""
    import fast_simplification

    new_vertices, new_faces, collapses = fast_simplification.simplify(
        vertices, faces, target_count=n_target, return_collapses=True
    )
    # Not by fast_simplification.replay_simplification: it maps a component that vanished onto another one.
    merged_into = _follow_collapses(collapses, len(vertices))
    renamed = merged_into[faces]
    a, b, c = renamed.T
    remaining = renamed[(a != b) & (b != c) & (c != a)]
    survivors = np.unique(remaining)
    if not np.array_equal(survivors[new_faces], remaining):
        raise PerturbationError(
            "decimation: the collapses reported by fast-simplification do not yield its faces, so counterparts are "
            "unknown; use backend=pymeshlab"
        )
    folded = _find_folded(new_faces)
    rest, counterpart_of_survivor = without_faces(as_trimesh(new_vertices, new_faces), folded)
    counterpart = np.full(len(vertices), -1)
    counterpart[survivors] = counterpart_of_survivor
    _merge_fold_tips(counterpart, renamed)
    return _Decimated(rest, counterpart[merged_into], int(np.count_nonzero(folded)))


def _follow_collapses(collapses: np.ndarray, n_vertices: int) -> np.ndarray:
    """(n,) the vertex into which each vertex was finally merged, after the (k, 2) collapses (kept, removed)."""
    into = np.arange(n_vertices)
    into[collapses[:, 1]] = collapses[:, 0]
    while (further := into[into] != into).any():
        into[further] = into[into[further]]
    return into


def _merge_fold_tips(counterpart: np.ndarray, faces: np.ndarray) -> None:
    """Give vertices that lost all their triangles the counterpart of a neighbour, as if by one more collapse."""
    tip = faces[:, [0, 0, 1, 1, 2, 2]].ravel()
    base = faces[:, [1, 2, 0, 2, 0, 1]].ravel()
    while (mergeable := (counterpart[tip] < 0) & (counterpart[base] >= 0)).any():
        counterpart[tip[mergeable]] = counterpart[base[mergeable]]


def _by_pymeshlab(vertices: np.ndarray, faces: np.ndarray, n_target: int) -> _Decimated:
    """Decimate with MeshLab; the counterpart of a vertex is the nearest vertex of its own component.

    Vertices that coincide remain apart, unless nothing could be removed then, as of triangles that share no vertices.
    """
    from scipy.spatial import cKDTree

    from heatwalk.laplacian import vertex_components

    n_coincident, n_welded = count_coincident(vertices, faces), 0
    part = vertex_components(len(vertices), faces) if n_coincident else np.zeros(len(vertices), dtype=np.int64)
    new_vertices, new_faces, new_part = _collapse_by_pymeshlab(
        separate_coincident(vertices, faces), faces, n_target, part
    )
    if n_coincident and len(new_faces) == len(faces):
        n_welded, part = n_coincident, np.zeros_like(part)
        new_vertices, new_faces, new_part = _collapse_by_pymeshlab(*weld(vertices, faces), n_target, part)
    folded = _find_folded(new_faces)
    rest, counterpart_of_new = without_faces(as_trimesh(new_vertices, new_faces), folded)
    apart = np.asarray(rest.vertices) + lattice_offsets(new_part[counterpart_of_new >= 0], part.max() + 1)
    counterpart = np.full(len(vertices), -1)
    used = np.unique(faces)
    distance, nearest = cKDTree(apart).query(vertices[used] + lattice_offsets(part[used], part.max() + 1))
    counterpart[used] = np.where(distance < LATTICE_SPACING / 2, nearest, -1)
    return _Decimated(rest, counterpart, int(np.count_nonzero(folded)), n_welded)


def _collapse_by_pymeshlab(
    vertices: np.ndarray, faces: np.ndarray, n_target: int, part: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Collapse edges until `n_target` faces remain, or none can be collapsed.

    Returns the vertices and faces that remain, and the part of each vertex, given that (n,) of the vertices before.
    """
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(mesh_with_parts(vertices, faces, part))
    # All flags are on: a flag that was once on remains on until the process ends, so any other choice would depend on
    # what ran before. Without planar quadrics, flat parts would lose nearly all vertices.
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=n_target,
        planarquadric=True,
        preservetopology=True,
        preservenormal=True,
        preserveboundary=True,
    )
    return result_with_parts(meshes.current_mesh())


def _find_folded(faces: np.ndarray) -> np.ndarray:
    """(m,) bool: faces to drop so that no face has a repeated vertex and no two have the same three.

    Of several faces with the same vertices, opposite ones cancel, and one remains if some are left over.
    """
    a, b, c = faces.T
    # Sign of the order of the corners as a permutation: 1 if even, -1 if odd, 0 for a repeated vertex.
    orientation = np.sign(b - a) * np.sign(c - a) * np.sign(c - b)
    _, group = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    left_over = np.sign(np.bincount(group, orientation))[group]
    kept = np.flatnonzero((orientation == left_over) & (orientation != 0))
    _, first = np.unique(group[kept], return_index=True)
    dropped = np.ones(len(faces), dtype=bool)
    dropped[kept[first]] = False
    return dropped
