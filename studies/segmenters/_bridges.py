"""Connections between the components of a dual graph, for methods that need a connected one."""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from studies.segmenters._dual_graph import DualGraph

_NEIGHBOURS = 8  # faces around each one among which others to connect it with are looked for


def connected_dual_graph(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> DualGraph:
    """The dual graph of a mesh, scaled to a box of unit size and made connected by `bridged`.

    Parameters
    ----------
    vertices : (n, 3) float array
        coordinates; their scale is free, because products of lengths at extreme ones are not finite
    faces : (m, 3) int array
        vertices of each face

    Raises
    ------
    ValueError
        If there are no faces, or if a coordinate is not finite.
    """
    if len(faces) == 0:
        raise ValueError("the mesh has no faces: there is nothing to segment")
    used = vertices[np.unique(faces)]
    if not np.isfinite(used).all():
        raise ValueError("a vertex of a face has a coordinate that is not finite; remove its faces")
    # In two steps: differences of the largest coordinates may not be finite.
    largest = np.abs(used).max() or 1.0
    low, high = used.min(axis=0) / largest, used.max(axis=0) / largest
    return bridged(DualGraph.of((vertices / largest - low) / ((high - low).max() or 1.0), faces))


def bridged(graph: DualGraph) -> DualGraph:
    """The dual graph with additional pairs of faces that make it connected.

    A face is connected with those of its eight nearest faces, in space, that belong to other components. As long as
    several components remain, the smallest is connected with the face of another one that is nearest to it. An
    additional pair is treated as two faces of a plane that share an edge of mean length: specks of dust become part of
    the surface nearest to them, and a triangle soup has neighbours.

    Parameters
    ----------
    graph : DualGraph
        of any mesh

    Returns
    -------
    DualGraph
        The same one if it is connected. Additional pairs are the last ones; their ``edges`` are -1, their ``angles`` 0.

    Examples
    --------
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> faces = np.concatenate([box.faces, box.faces + 8])
    >>> two = DualGraph.of(np.concatenate([box.vertices, box.vertices + 3]), faces)
    >>> len(two.pairs), len(bridged(two).pairs)
    (36, 37)
    """
    component = graph.components()
    if graph.n_faces == 0 or component.max() == 0:
        return graph
    pairs = _nearby_pairs(graph.centres, component)
    while True:
        component = _joined(component, pairs)
        if component.max() == 0:
            break
        inside = component == np.bincount(component).argmin()
        pairs = np.concatenate([pairs, [_nearest_pair(graph.centres, inside)]])
    return dataclasses.replace(
        graph,
        pairs=np.concatenate([graph.pairs, pairs]),
        edges=np.concatenate([graph.edges, np.full_like(pairs, -1)]),
        lengths=_with_means(graph.lengths, len(pairs)),
        angles=np.concatenate([graph.angles, np.zeros(len(pairs))]),
        distances=_with_means(graph.distances, len(pairs)),
    )


def _nearby_pairs(centres: NDArray[np.float64], component: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs (p, 2) of different components, of which one face is among the nearest of the other."""
    number = min(_NEIGHBOURS + 1, len(centres))
    _, nearest = cKDTree(centres).query(centres, number)
    pairs = np.column_stack([np.repeat(np.arange(len(centres)), number), nearest.ravel()])
    pairs = pairs[component[pairs[:, 0]] != component[pairs[:, 1]]]
    return np.unique(np.sort(pairs, axis=1), axis=0).astype(np.int64)


def _joined(component: NDArray[np.int64], pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """The number of each face's component once pairs are connected."""
    number = int(component.max()) + 1
    first, second = component[pairs].reshape(-1, 2).T
    matrix = sp.coo_array((np.ones(len(pairs)), (first, second)), (number, number))
    return connected_components(matrix, directed=False)[1].astype(np.int64)[component]


def _nearest_pair(centres: NDArray[np.float64], inside: NDArray[np.bool_]) -> tuple[int, int]:
    """The face of a component and the one of the others that are nearest to each other, the smaller index first."""
    own, other = np.flatnonzero(inside), np.flatnonzero(~inside)
    distance, nearest = cKDTree(centres[other]).query(centres[own])
    best = int(np.argmin(distance))
    first, second = sorted((int(own[best]), int(other[np.asarray(nearest)[best]])))
    return first, second


def _with_means(values: NDArray[np.float64], number: int) -> NDArray[np.float64]:
    """The values and, for each additional pair, their mean; 1 if there are none."""
    return np.concatenate([values, np.full(number, values.mean() if len(values) else 1.0)])
