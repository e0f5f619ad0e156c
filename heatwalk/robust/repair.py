"""A mesh repaired for measuring: thin handles cut, small holes filled, spikes removed, noise smoothed."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heatwalk.meshes import repeats_earlier_face
from heatwalk.robust.fairing import fair
from heatwalk.robust.half_edges import NON_MANIFOLD, adjacency, partners, without_long_edges
from heatwalk.robust.handles import cut_thin_handles
from heatwalk.robust.holes import fill_small_holes
from heatwalk.robust.spikes import remove_spikes
from heatwalk.robust.welds import part_welds

# Edges that are so many times as long as the others at both of their ends may be those of a thin handle.
MAX_EDGE = 3.0


@dataclass(frozen=True)
class Repair:
    """Which repairs are made, and how far each goes.

    Parameters
    ----------
    stitch : bool
        see `heatwalk.robust.stitching`; `heatwalk.segment_robust` does it before everything else
    cut_handles : bool
        see `heatwalk.robust.handles` and `heatwalk.robust.welds`
    fill_holes : bool
        see `heatwalk.robust.holes`
    remove_spikes : bool
        see `heatwalk.robust.spikes`
    fair : bool
        see `heatwalk.robust.fairing`
    max_handle : float
        longest loop around a handle that is cut, relative to the square root of the area
    min_excess : float
        least angle, in radians, by which the surface around it exceeds a flat one; 2π at the sharp end of a tube
    max_hole : float
        largest hole that is filled: the area of a disc with its perimeter, as a share of the area of the surface
    strength : float
        of the fairing: sweeps for a level of noise of 1, if nothing were tolerated
    tolerance : float
        level of noise of clean surfaces, up to which nothing is smoothed
    max_sweeps : int
        sweeps of the fairing at most
    max_restored : float
        how far vertices are moved back along the smoothed surface at most, in mean lengths of the edges around them
    """

    stitch: bool = True
    cut_handles: bool = True
    fill_holes: bool = True
    remove_spikes: bool = True
    fair: bool = True
    max_handle: float = 0.12
    min_excess: float = 3.2
    max_hole: float = 0.02
    strength: float = 11.0
    tolerance: float = 0.05
    max_sweeps: int = 512
    max_restored: float = 0.15

    def __post_init__(self) -> None:
        for name in ("max_handle", "min_excess", "max_hole", "strength", "tolerance", "max_restored"):
            value = getattr(self, name)
            if not 0 <= value < np.inf:
                raise ValueError(f"{name} must be at least 0 and finite, got {value!r}")
        if not isinstance(self.max_sweeps, int) or self.max_sweeps < 0:
            raise ValueError(f"max_sweeps must be a whole number, at least 0, got {self.max_sweeps!r}")

    def denoised(
        self, vertices: NDArray[np.float64], faces: NDArray[np.int64], *, with_handles: bool = False
    ) -> tuple[NDArray[np.float64], int, int]:
        """The vertices without spikes and noise, how many spikes there were, and how many sweeps were made.

        ``with_handles``: nothing is averaged along edges that are much longer than others, as those of a tube.
        """
        n_moved = sweeps = 0
        neighbours = adjacency(faces, len(vertices))
        if self.remove_spikes:
            vertices, moved = remove_spikes(vertices, *neighbours)
            n_moved = int(np.count_nonzero(moved))
        if self.fair:
            if with_handles:
                neighbours = without_long_edges(vertices, *neighbours, MAX_EDGE)
            vertices, sweeps = fair(
                vertices,
                faces,
                *neighbours,
                strength=self.strength,
                tolerance=self.tolerance,
                max_sweeps=self.max_sweeps,
                max_restored=self.max_restored,
            )
        return vertices, n_moved, sweeps

    def denoised_vertices(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
        """The vertices without spikes and noise."""
        return self.denoised(vertices, faces, with_handles=True)[0]


@dataclass(frozen=True)
class Repaired:
    """A repaired mesh.

    Attributes
    ----------
    vertices : (n', 3) float array
        the n vertices of the mesh, in their order, possibly moved; then those that were added
    faces : (m', 3) int array
        of a face that is there several times only the first is left
    report : dict of str to int
        ``nonmanifold_edges`` (of the mesh as it is), ``welds_parted`` (vertices), ``holes_filled``, ``handles_cut``,
        ``contacts_parted`` (spikes with their tips on the surface), ``vertices_moved`` (other spikes), and ``sweeps``
        (of the fairing)
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    report: dict[str, Any] = field(default_factory=dict)


def repaired(vertices: NDArray[np.float64], faces: NDArray[np.int64], options: Repair | None = None) -> Repaired:
    """Repair a mesh for measuring: for the metric only, as labels belong to the vertices of the mesh itself.

    Parameters
    ----------
    vertices : (n, 3) float array, finite
    faces : (m, 3) int array
    options : Repair, optional

    Returns
    -------
    Repaired

    Examples
    --------
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere()
    >>> repair = repaired(np.array(ball.vertices), np.array(ball.faces)[5:], Repair(fair=False))
    >>> len(repair.faces), repair.report["holes_filled"]
    (1280, 2)
    """
    options = Repair() if options is None else options
    n = len(vertices)
    # Exact, so that equal shapes of different size are repaired alike, and no square under- or overflows.
    exponent = int(np.frexp(np.abs(vertices).max())[1])
    vertices = np.ldexp(vertices, -exponent)
    improper = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    surface = np.ascontiguousarray(faces[~improper], np.int64)
    surface = surface[~repeats_earlier_face(surface)]
    report: dict[str, Any] = {
        "nonmanifold_edges": _count_nonmanifold_edges(surface, n),
        "welds_parted": 0,
        "holes_filled": 0,
        "handles_cut": 0,
        "contacts_parted": 0,
        "vertices_moved": 0,
        "sweeps": 0,
    }
    if options.cut_handles:
        vertices, surface, report["welds_parted"] = part_welds(vertices, surface)
    if options.fill_holes:
        vertices, surface, report["holes_filled"] = fill_small_holes(
            vertices, surface, options.max_hole, options.denoised_vertices
        )
    if options.cut_handles:
        vertices, surface, report["handles_cut"], report["contacts_parted"] = cut_thin_handles(
            vertices, surface, options.max_handle, options.min_excess, options.denoised_vertices
        )
    vertices, report["vertices_moved"], report["sweeps"] = options.denoised(vertices, surface)
    kept = np.arange(len(vertices)) < n
    kept[surface] = True
    number = np.cumsum(kept) - 1
    surface = np.concatenate([number[surface], faces[improper]])
    return Repaired(np.ldexp(vertices[kept], exponent), surface, report)


def _count_nonmanifold_edges(faces: NDArray[np.int64], n_vertices: int) -> int:
    """Number of edges with more than two faces."""
    sides = np.flatnonzero(partners(faces, n_vertices) == NON_MANIFOLD)
    edges = np.sort(np.column_stack([faces[sides // 3, sides % 3], faces[sides // 3, (sides + 1) % 3]]), axis=1)
    return len(np.unique(edges, axis=0))
