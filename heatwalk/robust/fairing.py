"""The surface smoothed over a fixed share of its size, however its triangles are distributed.

Noise makes a surface rough, which lengthens the ways of heat. One implicit step of mean curvature flow,

    (M + τ L) V' = M V,        τ = smoothing · area,

moves what is smaller than √τ and hardly anything larger, and means the same on every sampling of the shape, because the
stiffness L and the mass M are measured on the surface. But on a noisy surface these are those of the noise. So they are
measured on a copy from which noise has been taken by averaging with neighbours, in as many sweeps as the area of the
copy still falls by more than a share of it: none on a clean mesh.

The umbrella operator, which counts neighbours instead of measuring (a step with c (D - A) in place of τ L and D in place
of M), is as good against noise; but it smooths coarse parts over longer distances than fine ones.

References
----------
M. Desbrun, M. Meyer, P. Schröder, A. Barr, "Implicit fairing of irregular meshes using diffusion and curvature flow",
1999, doi:10.1145/311535.311576
"""

import numpy as np
from numpy.typing import NDArray

from heatwalk.laplacian import stiffness_and_mass
from heatwalk.numerics.compilation import compiled
from heatwalk.numerics.solver import PositiveDefiniteSolver
from heatwalk.numerics.sparse import scale_symmetric
from heatwalk.numerics.triangles import areas


def fair(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
    *,
    smoothing: float,
    first_sweeps: int,
    max_sweeps: int,
    max_decrease: float,
) -> NDArray[np.float64]:
    """Smooth a surface.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    starts, neighbours
        as from `heatwalk.robust.half_edges.adjacency`
    smoothing : float
        τ as a share of the area
    first_sweeps, max_sweeps : int
        of averaging before measuring, at least and at most
    max_decrease : float
        another round of sweeps, twice as many, follows while the last decreased the area by more than this share

    Returns
    -------
    (n, 3) float array
    """
    measured = denoised(vertices, faces, starts, neighbours, first_sweeps, max_sweeps, max_decrease)
    stiffness, mass = stiffness_and_mass(measured, faces)
    step = smoothing * float(areas(measured, faces).sum())
    # With u = M^{1/2} V': (I + τ M^{-1/2} L M^{-1/2}) u = M^{1/2} V.
    root = np.sqrt(mass)
    matrix = scale_symmetric(stiffness, np.sqrt(step) / root)
    solver = PositiveDefiniteSolver(matrix, shift=-1.0)
    smooth = np.empty_like(vertices)
    smooth[solver.order] = solver.solve(root[solver.order, None] * vertices[solver.order]) / root[solver.order, None]
    return smooth


def denoised(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
    first_sweeps: int,
    max_sweeps: int,
    max_decrease: float,
) -> NDArray[np.float64]:
    """The surface after as many sweeps of averaging as its area falls: (n, 3) float array; parameters as of `fair`."""
    sweeps, total = first_sweeps, first_sweeps
    vertices = average(vertices, starts, neighbours, first_sweeps)
    area = float(areas(vertices, faces).sum())
    while total + sweeps <= max_sweeps:
        smoother = average(vertices, starts, neighbours, sweeps)
        before, area = area, float(areas(smoother, faces).sum())
        if area >= (1 - max_decrease) * before:
            break
        vertices = smoother
        total += sweeps
        sweeps = total
    return vertices


@compiled
def average(
    vertices: NDArray[np.float64], starts: NDArray[np.int64], neighbours: NDArray[np.int64], sweeps: int
) -> NDArray[np.float64]:
    """Each vertex replaced by the mean of itself and the mean of its neighbours, a number of times: (n, 3)."""
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
