"""Decimation: fewer triangles for the same shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

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
    Triangles that the collapses folded onto each other (with the same three vertices) are removed, in pairs of
    opposite orientation or down to one; the tip of a fold counts as merged into its base. A component that folds
    completely disappears, as does a double sheet that was already in the mesh; `Perturbed.applied` counts these
    triangles. If fast_simplification pinches a thin part, an edge with four triangles may remain; pymeshlab preserves
    the topology.

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
        n_faces = len(mesh.faces)
        by_collapses = self.backend == "fast_simplification"
        decimated, counterpart, n_folded = self._decimate(mesh, round(self.amount * n_faces))
        return self.finish(
            mesh,
            decimated,
            counterpart,
            share_of_faces_kept=len(decimated.faces) / n_faces,
            folded_triangles_removed=n_folded,
            counterpart_by="collapses" if by_collapses else "nearest_vertex",
        )

    def _decimate(self, mesh: trimesh.Trimesh, n_target: int) -> tuple[trimesh.Trimesh, np.ndarray, int]:
        """Return the decimated mesh, the counterpart of each vertex, and the number of folded triangles removed."""
        if n_target == len(mesh.faces):
            return as_trimesh(mesh.vertices, mesh.faces), np.arange(len(mesh.vertices)), 0
        # In a box of size 1, because the error threshold of fast-simplification is absolute.
        corner, size = mesh.bounds[0], mesh.extents.max()
        vertices = (np.asarray(mesh.vertices) - corner) / size
        backend = _by_fast_simplification if self.backend == "fast_simplification" else _by_pymeshlab
        rest, counterpart, n_folded = backend(vertices, np.asarray(mesh.faces), n_target)
        return as_trimesh(np.asarray(rest.vertices) * size + corner, rest.faces), counterpart, n_folded


def _by_fast_simplification(
    vertices: np.ndarray, faces: np.ndarray, n_target: int
) -> tuple[trimesh.Trimesh, np.ndarray, int]:
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
    return rest, counterpart[merged_into], int(np.count_nonzero(folded))


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


def _by_pymeshlab(vertices: np.ndarray, faces: np.ndarray, n_target: int) -> tuple[trimesh.Trimesh, np.ndarray, int]:
    """Decimate with MeshLab; the counterpart of a vertex is the nearest vertex."""
    import pymeshlab
    from scipy.spatial import cKDTree

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    # All flags are on: a flag that was once on remains on until the process ends, so any other choice would depend on
    # what ran before. Without planar quadrics, flat parts would lose nearly all vertices.
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=n_target,
        planarquadric=True,
        preservetopology=True,
        preservenormal=True,
        preserveboundary=True,
    )
    decimated = meshes.current_mesh()
    new_faces = decimated.face_matrix().astype(np.int64)
    folded = _find_folded(new_faces)
    rest, _ = without_faces(as_trimesh(decimated.vertex_matrix(), new_faces), folded)
    counterpart = np.full(len(vertices), -1)
    used = np.unique(faces)
    counterpart[used] = cKDTree(rest.vertices).query(vertices[used])[1]
    return rest, counterpart, int(np.count_nonzero(folded))


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
