"""What it costs to cut a mesh along its edges: little where they are concave."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from studies.segmenters._dual_graph import DualGraph

# A connected component below this share of the area is a segment of its own and does not count as one of those that a
# method is told to find: a speck beside a model is no part of it.
_SPECK = 1e-3


def cut_costs(graph: DualGraph, exponent: float, least: float = 0.0) -> NDArray[np.float64]:
    """What it costs to separate each pair of faces: the length of their edge times w = min((θ / π)^exponent, 1).

    θ is the exterior dihedral angle, above π where the edge is convex (Golovinskiy, Funkhouser 2008).

    Parameters
    ----------
    graph : DualGraph
    exponent : float
        how much cheaper concave edges are
    least : float
        w is raised to (w + least) / (1 + least)

    Returns
    -------
    (p,) float array

    Examples
    --------
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> graph = DualGraph.of(box.vertices, box.faces)
    >>> np.array_equal(cut_costs(graph, 10), graph.lengths)
    True
    """
    w = np.minimum(1 + graph.angles / np.pi, 1) ** exponent
    return graph.lengths * (w + least) / (1 + least)


def regularised_areas(graph: DualGraph, share: float) -> NDArray[np.float64]:
    """Areas of the faces, all above zero: those that they have plus a share of their mean.

    Parameters
    ----------
    graph : DualGraph
    share : float
        of the mean area of a face; without it, faces with hardly any area would be merged before all others

    Returns
    -------
    (m,) float array
    """
    mean = graph.areas.sum() / max(graph.n_faces, 1)
    return graph.areas + max(share, 1e-9) * (mean if mean > 0 else 1.0)


def number_of_regions(graph: DualGraph, n_segments: int) -> int:
    """How many regions a mesh has that is cut into `n_segments`, beside components that are specks.

    Every connected component is at least one region.

    Parameters
    ----------
    graph : DualGraph
    n_segments : int
        at least 1

    Raises
    ------
    ValueError
        If `n_segments` is below 1.

    Examples
    --------
    >>> import trimesh
    >>> ball, speck = trimesh.creation.icosphere(1), trimesh.creation.icosphere(0, radius=0.01)
    >>> both = trimesh.util.concatenate([ball, speck.apply_translation([2, 0, 0])])
    >>> number_of_regions(DualGraph.of(both.vertices, both.faces), 3)
    4
    """
    if n_segments < 1:
        raise ValueError(f"n_segments must be at least 1, got {n_segments}")
    is_large = large_components(graph)
    n_large = int(np.count_nonzero(is_large))
    return len(is_large) - n_large + (max(n_segments, n_large) if n_large else 0)


def large_components(graph: DualGraph) -> NDArray[np.bool_]:
    """Which connected components are no specks, by their number: (c,)."""
    areas = np.bincount(graph.components(), graph.areas)
    return areas >= max(_SPECK * areas.sum(), np.finfo(float).tiny)
