"""Noise taken from a surface, as much as there is of it.

Noise makes a surface rough: it lengthens the ways of heat and inflates the area, and with it the scale of time. But
what smooths noise also shrinks limbs, the more the coarser they are sampled, so that a smoothed mesh and a smoothed
coarser mesh of the same shape differ more than the meshes themselves. So the strength follows from the noise that is
measured, and the filter leaves what is larger than a few edges where it is.

    P    = averaging: each vertex is replaced by the mean of itself and the mean of its neighbours
    rms  = root mean square of the component of (I - N)² V along the normal, N = 2 P - I, over the mean edge length
    m    = round(strength · rms²) sweeps: none on a clean mesh, where (I - N)² V is the change of the curvature
    V'   = V - (I - P^m)³ V
    while area(V') exceeds area(V' with 2 m) by more than a share: m = 2 m

White noise of σ edge lengths has an rms of about 1.3 σ, clean benchmark meshes have up to .1, and such with a tenth of
their triangles .16: rounding makes that no sweep or a single one. The filter V - (I - P^m)³ V is P^m twice mended by
the smoothed residual: a mode that P^m leaves as 1 - ε, it leaves as 1 - ε³. Whether an edge is long or short plays no
role for what it leaves in place.

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
from heatwalk.numerics.triangles import areas

# How often the residual of smoothing is smoothed and added back, plus one.
ORDER = 3


def fair(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
    *,
    strength: float,
    max_sweeps: int,
    max_decrease: float,
) -> tuple[NDArray[np.float64], int]:
    """Smooth a surface as its noise requires.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    starts, neighbours
        as from `heatwalk.robust.half_edges.adjacency`
    strength : float
        sweeps for noise of one edge length
    max_sweeps : int
        sweeps at most
    max_decrease : float
        twice as many sweeps are made as long as that decreases the area by more than this share

    Returns
    -------
    vertices : (n, 3) float array
        the input itself if there is no noise
    sweeps : int
    """
    sweeps = min(round(strength * noise_level(vertices, faces, starts, neighbours) ** 2), max_sweeps)
    if sweeps == 0:
        return vertices, 0
    smooth = smoothed(vertices, starts, neighbours, sweeps)
    # Noise of more than an edge length makes edges as long as itself: only its area tells how much more it is.
    if sweeps >= MANY_SWEEPS * strength:
        area = areas(smooth, faces).sum()
        while 2 * sweeps <= max_sweeps:
            smoother = smoothed(vertices, starts, neighbours, 2 * sweeps)
            before, area = area, areas(smoother, faces).sum()
            if area >= (1 - max_decrease) * before:
                break
            smooth, sweeps = smoother, 2 * sweeps
    return smooth, sweeps


# Where the noise is at least this share of the strength, there may be more than an edge length of it.
MANY_SWEEPS = 0.5


def noise_level(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
) -> float:
    """Root mean square of (I - N)² V along the normal, relative to the mean edge length; parameters as of `fair`."""
    once = average(vertices, starts, neighbours, 1)
    twice = average(once, starts, neighbours, 1)
    rough = 4 * (vertices - 2 * once + twice)
    normals = _vertex_normals(smoothed(vertices, starts, neighbours, 4), faces)
    heights = np.einsum("ij,ij->i", rough, normals)
    ends = np.repeat(np.arange(len(vertices)), np.diff(starts))
    length = np.linalg.norm(vertices[ends] - vertices[neighbours], axis=1).mean() if len(ends) else 0.0
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
