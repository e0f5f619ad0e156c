"""Other tessellations of the same shape."""

from dataclasses import dataclass
from typing import ClassVar

import fast_simplification
import numpy as np
import pymeshlab
import trimesh
from scipy.spatial import cKDTree

from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed, without_faces


@dataclass(frozen=True)
class Decimation(Perturbation):
    """Edges are collapsed, those of least quadric error first, until a share of the faces is left.

    amount : the share of faces kept, above 0 to 1; 1 is the identity. A simplifier may stop early, when no
        collapse is left that it allows: `applied` holds the share that was really kept.
    backend : fast_simplification, where a vertex's counterpart is the vertex it was collapsed into; or
        pymeshlab, which does not tell, and where it is the nearest vertex. `counterpart_by` in `applied` says
        which.

    Triangles that the collapses folded onto each other (same three vertices) are removed, in pairs of
    opposite orientation or down to one; the tip of a fold counts as merged into its root. A component that
    folds as a whole is gone, as is a double sheet that the mesh had from the start; `applied` counts these
    triangles. Where fast_simplification pinches a thin part, an edge of four triangles may be left; pymeshlab
    keeps the topology.
    Source: paper section 6.6, Figure 13. Nothing is left to chance. The quadric error: Garland and Heckbert
    1997, doi:10.1145/258734.258849.
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
        self._check_number("amount", most=1, positive=True)

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        n_faces = len(mesh.faces)
        target = round(self.amount * n_faces)
        by_collapses = self.backend == "fast_simplification"
        if target == n_faces:
            rest, counterpart, folded = mesh.copy(), np.arange(len(mesh.vertices)), 0
        else:
            # In a box of size 1, because fast-simplification's error threshold is absolute.
            corner, size = mesh.bounds[0], mesh.extents.max()
            vertices = (np.asarray(mesh.vertices) - corner) / size
            decimate = _by_fast_simplification if by_collapses else _by_pymeshlab
            rest, counterpart, folded = decimate(vertices, np.asarray(mesh.faces), target)
            rest = trimesh.Trimesh(np.asarray(rest.vertices) * size + corner, rest.faces, process=False)
        return self._finish(
            mesh,
            rest,
            counterpart,
            share_of_faces_kept=len(rest.faces) / n_faces,
            folded_triangles_removed=folded,
            counterpart_by="collapses" if by_collapses else "nearest_vertex",
        )


def _by_fast_simplification(
    vertices: np.ndarray, faces: np.ndarray, target: int
) -> tuple[trimesh.Trimesh, np.ndarray, int]:
    """The decimated mesh, the counterpart of every vertex, and how many folded triangles were removed."""
    new_vertices, new_faces, collapses = fast_simplification.simplify(
        vertices, faces, target_count=target, return_collapses=True
    )
    into = np.arange(len(vertices))
    into[collapses[:, 1]] = collapses[:, 0]
    while (further := into[into] != into).any():
        into[further] = into[into[further]]
    # Not fast_simplification.replay_simplification: it maps a component that vanished onto another one.
    renamed = into[faces]
    a, b, c = renamed.T
    left = renamed[(a != b) & (b != c) & (c != a)]
    survivors = np.unique(left)
    if not np.array_equal(survivors[new_faces], left):
        raise PerturbationError(
            "decimation: fast-simplification's collapses do not give its faces, so there is no vertex map; "
            "use backend=pymeshlab"
        )
    folded = _folded(new_faces)
    rest, kept_as = without_faces(trimesh.Trimesh(new_vertices, new_faces, process=False), folded)
    counterpart = np.full(len(vertices), -1)
    counterpart[survivors] = kept_as
    # What lost all its triangles, such as the tip of a fold, merges into a neighbour: one more collapse.
    tip = renamed[:, [0, 0, 1, 1, 2, 2]].ravel()
    root = renamed[:, [1, 2, 0, 2, 0, 1]].ravel()
    while (hanging := (counterpart[tip] < 0) & (counterpart[root] >= 0)).any():
        counterpart[tip[hanging]] = counterpart[root[hanging]]
    return rest, counterpart[into], int(np.count_nonzero(folded))


def _by_pymeshlab(vertices: np.ndarray, faces: np.ndarray, target: int) -> tuple[trimesh.Trimesh, np.ndarray, int]:
    """The same by MeshLab, with the nearest vertex as counterpart."""
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    # All flags on: once on, one stays on until the process ends, and any other choice would depend on what
    # ran before. Planar quadrics are needed besides: without them flat parts lose nearly all vertices.
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=target,
        planarquadric=True,
        preservetopology=True,
        preservenormal=True,
        preserveboundary=True,
    )
    decimated = meshes.current_mesh()
    new_faces = decimated.face_matrix().astype(np.int64)
    folded = _folded(new_faces)
    rest, _ = without_faces(trimesh.Trimesh(decimated.vertex_matrix(), new_faces, process=False), folded)
    counterpart = np.full(len(vertices), -1)
    used = np.unique(faces)
    counterpart[used] = cKDTree(rest.vertices).query(vertices[used])[1]
    return rest, counterpart, int(np.count_nonzero(folded))


def _folded(faces: np.ndarray) -> np.ndarray:
    """(m,) bool: faces to drop so that no face has a repeated vertex and no two have the same three.

    Of several on the same vertices, opposite ones cancel, and one stays if something is left over.
    """
    a, b, c = faces.T
    # Of the corners' order as a permutation: 1 even, -1 odd, 0 for a repeated vertex.
    orientation = np.sign(b - a) * np.sign(c - a) * np.sign(c - b)
    _, group = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    left_over = np.sign(np.bincount(group, orientation))[group]
    stays = np.flatnonzero((orientation == left_over) & (orientation != 0))
    _, first = np.unique(group[stays], return_index=True)
    dropped = np.ones(len(faces), dtype=bool)
    dropped[stays[first]] = False
    return dropped
