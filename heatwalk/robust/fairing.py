"""Noise taken from a surface, as much as there is of it.

Noise makes a surface rough: it lengthens the ways of heat and inflates the area, and with it the scale of time. But
what smooths noise also shrinks limbs, the more the coarser they are sampled, so that a smoothed mesh and a smoothed
coarser mesh of the same shape differ more than the meshes themselves. So the strength follows from the noise that is
measured, and the filter leaves what is larger than a few edges where it is.

    P     = averaging: each vertex is replaced by the mean of itself and the mean of its neighbours
    S     = V - (I - P^m)³ V, the surface smoothed by m sweeps
    level = root mean square of the component of (I - N)² V, N = 2 P - I, along the normals of S,
            over the mean edge length of S
    m     = round(strength · (√level - √tolerance)), measured again with that m until it hardly grows
    V'    = S, and of V - S what is along the surface, up to a share of the edges around

White noise of σ edge lengths has a level of about 1.3 σ; of clean benchmark meshes it is up to .08, of such with a
tenth of their triangles .09 to .2, because (I - N)² V is the change of the curvature there. Noise of more than an edge
length makes edges as long as itself; those of the smoothed surface tell how much it is. With the root, noise of .1, 1
and 10 edge lengths takes 2, 10 and 37 sweeps: what is lost of thin limbs grows with the sweeps as the roughness that is
left of the noise falls, and from one edge length on, twice as many were worse.

The filter V - (I - P^m)³ V is P^m twice mended by the smoothed residual: a mode that P^m leaves as 1 - ε, it leaves as
1 - ε³. Whether an edge is long or short plays no role for what it leaves in place. But averaging also evens out how the
vertices are distributed over the surface, which moves them along it, and with them the borders of the regions. So they
are moved back; not farther than a share of the edges, as noise much larger than that has a part along the surface, too.

An implicit step over a fixed share of the surface, with the umbrella operator or with cotangents and masses, is as good
against noise, but worse than nothing under decimation and uneven sampling: thin limbs collapse, each time differently.

References
----------
J. W. Tukey, "Exploratory Data Analysis", 1977 (twicing); G. Taubin, "A signal processing approach to fair surface
design", 1995, doi:10.1145/218380.218473
"""

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled

# How often the residual of smoothing is smoothed and added back, plus one.
ORDER = 3


def fair(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
    *,
    strength: float,
    tolerance: float,
    max_sweeps: int,
    max_restored: float,
) -> tuple[NDArray[np.float64], int]:
    """Smooth a surface as its noise requires.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    starts, neighbours
        as from `heatwalk.robust.half_edges.adjacency`
    strength : float
        sweeps for a level of 1, if nothing were tolerated
    tolerance : float
        level of clean surfaces, up to which nothing is done
    max_sweeps : int
        sweeps at most
    max_restored : float
        how far vertices are moved back along the surface at most, in mean lengths of the edges around them

    Returns
    -------
    vertices : (n, 3) float array
        the input itself if there is no noise
    sweeps : int
    """
    sweeps = 0
    while True:
        smooth = smoothed(vertices, starts, neighbours, max(sweeps, LEAST_SWEEPS))
        level = noise_level(vertices, smooth, faces, starts, neighbours)
        required = min(round(strength * (np.sqrt(max(level, tolerance)) - np.sqrt(tolerance))), max_sweeps)
        if required <= LEAST_SWEEPS:
            sweeps = required
            break
        if required <= GROWTH * sweeps:
            break
        sweeps = required
    if sweeps == 0:
        return vertices, 0
    normals = _vertex_normals(smooth, faces)
    if sweeps < LEAST_SWEEPS:
        smooth = smoothed(vertices, starts, neighbours, sweeps)
    back = vertices - smooth
    back -= np.einsum("ij,ij->i", back, normals)[:, None] * normals
    longest = max_restored * _mean_edge_lengths(smooth, starts, neighbours)
    share = np.minimum(1.0, longest / np.maximum(np.linalg.norm(back, axis=1), np.finfo(float).tiny))
    return smooth + share[:, None] * back, sweeps


# Normals and lengths are measured on a surface smoothed by at least so many sweeps.
LEAST_SWEEPS = 4

# The level is not measured again for less than this times as many sweeps.
GROWTH = 1.1


def noise_level(
    vertices: NDArray[np.float64],
    smooth: NDArray[np.float64],
    faces: NDArray[np.int64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
) -> float:
    """Root mean square of (I - N)² V along the normals of a smooth surface, relative to its mean edge length.

    Parameters
    ----------
    vertices : (n, 3) float array
    smooth : (n, 3) float array
        the same surface, smoothed
    faces, starts, neighbours
        as of `fair`
    """
    once = average(vertices, starts, neighbours, 1)
    twice = average(once, starts, neighbours, 1)
    heights = np.einsum("ij,ij->i", 4 * (vertices - 2 * once + twice), _vertex_normals(smooth, faces))
    n_ends = len(neighbours)
    length = _mean_edge_lengths(smooth, starts, neighbours) @ np.diff(starts) / n_ends if n_ends else 0.0
    return float(np.sqrt(np.mean(heights**2)) / length) if length > 0 else 0.0


def smoothed(
    vertices: NDArray[np.float64], starts: NDArray[np.int64], neighbours: NDArray[np.int64], sweeps: int
) -> NDArray[np.float64]:
    """V - (I - P^m)³ V with m = ``sweeps``: (n, 3) float array."""
    rest = vertices
    for _ in range(ORDER):
        rest = rest - average(rest, starts, neighbours, sweeps)
    return vertices - rest


def _vertex_normals(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit normals of the vertices, weighted by area; zero where there is none: (n, 3) float array."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = _sum_at_corners(np.cross(b - a, c - a), faces, len(vertices))
    return normals / np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]


@compiled
def _sum_at_corners(values: NDArray[np.float64], faces: NDArray[np.int64], n_vertices: int) -> NDArray[np.float64]:
    """Sum of the rows (m, 3) of the faces around each vertex: (n_vertices, 3) float array."""
    total = np.zeros((n_vertices, 3))
    for f in range(len(faces)):
        for i in range(3):
            for k in range(3):
                total[faces[f, i], k] += values[f, k]
    return total


@compiled
def _mean_edge_lengths(
    vertices: NDArray[np.float64], starts: NDArray[np.int64], neighbours: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Mean length of the edges of each vertex; 0 without edges: (n,) float array."""
    mean = np.zeros(len(vertices))
    for v in range(len(vertices)):
        for i in range(starts[v], starts[v + 1]):
            w = neighbours[i]
            dx, dy, dz = (
                vertices[v, 0] - vertices[w, 0],
                vertices[v, 1] - vertices[w, 1],
                vertices[v, 2] - vertices[w, 2],
            )
            mean[v] += np.sqrt(dx * dx + dy * dy + dz * dz) / (starts[v + 1] - starts[v])
    return mean


@compiled
def average(
    vertices: NDArray[np.float64], starts: NDArray[np.int64], neighbours: NDArray[np.int64], sweeps: int
) -> NDArray[np.float64]:
    """P^m V with m = ``sweeps``: (n, 3) float array; a vertex without neighbours stays where it is."""
    current, result = vertices.copy(), vertices.copy()
    for _ in range(sweeps):
        for v in range(len(vertices)):
            count = starts[v + 1] - starts[v]
            if count == 0:
                continue
            x = y = z = 0.0
            for i in range(starts[v], starts[v + 1]):
                w = neighbours[i]
                x += current[w, 0]
                y += current[w, 1]
                z += current[w, 2]
            result[v, 0] = 0.5 * (current[v, 0] + x / count)
            result[v, 1] = 0.5 * (current[v, 1] + y / count)
            result[v, 2] = 0.5 * (current[v, 2] + z / count)
        current, result = result, current
    return current
