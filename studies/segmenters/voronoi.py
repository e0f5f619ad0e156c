"""Cells around random faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from studies.segmenters._dual_graph import DualGraph
from studies.segmenters._random import random_generator
from studies.segmenters.about import About


@dataclass(frozen=True)
class Voronoi:
    """Cells of the faces nearest, along the surface, to faces drawn at random with probabilities in proportion to area.

    A baseline that knows the number of segments and nothing else. A connected component without a drawn face belongs
    to the first cell.

    Examples
    --------
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere(3)
    >>> len(np.unique(Voronoi()(sphere.vertices, sphere.faces, n_segments=5)))
    5
    """

    algorithm_version: ClassVar[int] = 1
    labels_of: ClassVar[str] = "faces"
    about: ClassVar[About] = About(title="Voronoi cells", seeded=True, baseline=True)

    def __call__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64], n_segments: int) -> NDArray[np.int64]:
        """Labels of the faces.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face
        n_segments : int
            how many cells

        Returns
        -------
        (m,) int64 array
        """
        graph = DualGraph.of(vertices, faces)
        total = graph.areas.sum()
        weights = graph.areas / total if total > 0 else np.full(len(faces), 1 / len(faces))
        number = min(n_segments, int(np.count_nonzero(weights)))
        seeds = random_generator(vertices, faces).choice(len(faces), number, replace=False, p=weights)
        ways = graph.matrix(np.maximum(graph.distances, np.finfo(float).tiny))
        _, _, nearest = dijkstra(ways, directed=False, indices=seeds, min_only=True, return_predecessors=True)
        cell_of = np.zeros(len(faces) + 1, dtype=np.int64)
        cell_of[seeds] = range(number)
        return cell_of[np.where(nearest < 0, len(faces), nearest)]
