"""Segmentation of a mesh: operator, spectrum, heat kernel, heat walk, dissipators, in this order."""

import time as clock
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heatwalk.accumulators import HeatWalk, heat_walk
from heatwalk.confidence import label_margin
from heatwalk.dissipators import divergence_from_uniform, relative_entropy_excess
from heatwalk.kernel import HeatKernel, largest_eigenvalue
from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from heatwalk.meshes import check_mesh, without_repeated_faces
from heatwalk.numerics.threads import one_blas_thread, sharing_everything, with_threads, working_threads
from heatwalk.options import DENSITIES, TIME_UNITS
from heatwalk.spectrum import Spectrum, SpectrumSolver

# Time 1 of the paper on a mesh of area 1, in units of the heat equation ∂u/∂t = Δu: the paper's operator is Δ/6.
PAPER_TIME = 1 / 6


@dataclass(frozen=True)
class Segmentation:
    """Heat Walk segmentation of a mesh with n vertices and m faces.

    Attributes
    ----------
    labels : (n,) int array
        0 … K-1 the accumulator regions, K the dissipator region (K, K+1 … its connected pieces with
        ``split_dissipators``). A region whose vertices all dissipate keeps its number and has no vertex.
    accumulator_labels : (n,) int array, 0 … K-1
        the regions before the dissipator step
    face_labels : (m,) int array
        ``labels`` transferred to the faces: the label of at least two corners, otherwise that of the first corner
    exemplars : (K,) int array, ascending
        the vertex at which each accumulator region accumulates heat, the end of its paths
    relative_entropy_excess : (n,) float array
        KL(p_x ‖ q_C) − KL(p_x ‖ uniform) in nats; a vertex dissipates if it is positive
    walk : HeatWalk
        the forest of the walk and its history
    kernel : HeatKernel
    spectrum : Spectrum
    time : float
        in the units of the paper, on the mesh scaled to area 1
    standard_time : float
        ``time / 6``, in units of the heat equation ∂u/∂t = Δu
    fiedler_time : float
        standard time multiplied by the smallest positive eigenvalue: dimensionless, independent of the area
    seconds : dict
        wall-clock seconds per stage: compilation (0 once the inner loops are in numba's cache), operator (including the
        check of the mesh), spectrum, walk, dissipators
    """

    labels: NDArray[np.int64]
    accumulator_labels: NDArray[np.int64]
    face_labels: NDArray[np.int64]
    exemplars: NDArray[np.int64]
    relative_entropy_excess: NDArray[np.float64]
    walk: HeatWalk
    kernel: HeatKernel
    spectrum: Spectrum
    time: float
    standard_time: float
    fiedler_time: float
    seconds: dict[str, float] = field(compare=False)
    _weights: NDArray[np.float64] | None = field(repr=False, default=None)

    @property
    def n_components(self) -> int:
        """Number of connected components of the mesh; each has at least one accumulator region."""
        return len(self.spectrum.eigenvalues)

    @property
    def n_segments(self) -> int:
        """Number of labels with at least one vertex, including the dissipator region."""
        return len(np.unique(self.labels))

    @property
    def dissipates(self) -> NDArray[np.bool_]:
        """Whether each vertex is in the dissipator region: (n,) bool array."""
        return self.relative_entropy_excess > 0

    @cached_property
    @one_blas_thread()
    def divergence_from_uniform(self) -> NDArray[np.float64]:
        """KL(p_x ‖ uniform), (n,) float array in nats (paper, Figure 4 b); O(n²) time on first access."""
        return divergence_from_uniform(self.kernel, self._weights)

    @cached_property
    @one_blas_thread()
    def margin(self) -> NDArray[np.float64]:
        """How far the label of each vertex is from another one: (n,) float array in [0, 1], 0 if another ties with it.

        The smallest of the margins of all choices that lead to the label; see `heatwalk.confidence`. Computed on first
        access, in O(n) time for each vertex that others choose.
        """
        return label_margin(self.kernel, self.walk, self.accumulator_labels, self.relative_entropy_excess)

    @property
    def divergence_from_region(self) -> NDArray[np.float64]:
        """KL(p_x ‖ q_C) with the region C of x: (n,) float array in nats (paper, Figure 4 c)."""
        return self.divergence_from_uniform + self.relative_entropy_excess


def segment(
    vertices: ArrayLike,
    faces: ArrayLike,
    time: float = 1.0,
    *,
    time_unit: str = "paper",
    density: str = "vertices",
    split_dissipators: bool = False,
    threads: int | None = None,
) -> Segmentation:
    """Segment a triangle mesh with the Heat Walk.

    Parameters
    ----------
    vertices : (n, 3) array of coordinates, in any unit
    faces : (m, 3) array of vertex indices
    time : float
        duration of the heat flow, by default in the units of the paper, which uses 1 throughout; longer times give
        fewer segments
    time_unit : {"paper", "standard", "fiedler"}
        "standard": ∂u/∂t = Δu on the mesh of area 1, six times the unit of the paper; "fiedler": multiples of 1/λ₁, the
        inverse of the smallest positive eigenvalue
    density : {"vertices", "area"}
        whether heat densities are sums over vertices, as in the paper, or integrals over the surface
    split_dissipators : bool
        give each connected piece of the dissipator region its own label
    threads : int, optional
        how many threads share the work if the mesh is large, at least 1; by default as many as this process may use:
        its processors, or the number in the environment variable ``OMP_NUM_THREADS``. The result does not depend on it

    Returns
    -------
    Segmentation

    Raises
    ------
    MeshError
        (a ValueError) if the mesh cannot be segmented
    SpectrumError
        if the eigensolver does not reach its required residual
    ValueError
        if the time is not positive and finite, an option is unknown, or ``threads`` is not a positive integer

    Notes
    -----
    The mesh is scaled to area 1, the total area of all components. Heat does not cross from one component to another,
    so that each has its own regions, and the uniform density of the dissipator test is that of the component. Of faces
    with the same three corners, in any order, one counts: a face that is there in both windings has its area once.

    References
    ----------
    W. Benjamin, A. W. Polk, S. V. N. Vishwanathan, K. Ramani, "Heat Walk: Robust Salient Segmentation of Non-rigid
    Shapes", 2011

    Examples
    --------
    >>> import trimesh
    >>> mesh = trimesh.creation.torus(1, 0.4)
    >>> seg = segment(mesh.vertices, mesh.faces, time=4)
    >>> len(seg.labels) == len(mesh.vertices)
    True
    >>> bool((seg.accumulator_labels[seg.exemplars] == range(len(seg.exemplars))).all())
    True
    """
    return next(
        segment_at_times(
            vertices,
            faces,
            [time],
            time_unit=time_unit,
            density=density,
            split_dissipators=split_dissipators,
            threads=threads,
        )
    )


def segment_at_times(
    vertices: ArrayLike,
    faces: ArrayLike,
    times: Sequence[float],
    *,
    time_unit: str = "paper",
    density: str = "vertices",
    split_dissipators: bool = False,
    threads: int | None = None,
) -> Iterator[Segmentation]:
    """Segment a triangle mesh with the Heat Walk at several times, from a single spectrum: that of the shortest time.

    Parameters
    ----------
    vertices, faces, time_unit, density, split_dissipators, threads
        as in `segment`
    times : sequence of floats, in any order

    Returns
    -------
    iterator of Segmentation
        one per time, in the order of ``times``, with the same labels as from `segment`. Each is computed when the
        iterator reaches it; the mesh is checked and its spectrum computed by the call itself. The ``seconds`` of each
        include the operator and the spectrum in full, although they are shared.

    Raises
    ------
    MeshError, SpectrumError, ValueError
        as `segment`; also ValueError if ``times`` is empty

    Examples
    --------
    >>> import trimesh
    >>> mesh = trimesh.creation.icosphere(3).apply_scale([4, 1.2, 1])
    >>> few, many = segment_at_times(mesh.vertices, mesh.faces, [10, 0.3])
    >>> len(few.exemplars) < len(many.exemplars)
    True
    """
    times = check_times(times, time_unit, density)
    with working_threads(threads):
        stopwatch = Stopwatch()
        vertices, faces = check_mesh(vertices, faces)
        surface = without_repeated_faces(faces)
        stiffness, mass = stiffness_and_mass(unit_area(vertices, surface), surface)
        component = vertex_components(len(vertices), faces)
        del vertices, surface
        shared_seconds = {"operator": stopwatch.lap()}

        solver = SpectrumSolver(stiffness, mass, component)
        del stiffness
        standard_times = in_standard_units(times, time_unit, solver)
        spectrum = solver.up_to(largest_eigenvalue(min(standard_times)))
        del solver  # the factor is larger than everything that follows
        shared_seconds["spectrum"] = stopwatch.lap()
        shared_seconds["compilation"] = stopwatch.compilation
    weights = mass if density == "area" else None
    return (
        with_threads(threads, _segment_at_time, faces, spectrum, time, weights, split_dissipators, shared_seconds)
        for time in standard_times
    )


def check_times(times: Sequence[float], time_unit: str, density: str) -> list[float]:
    """The times as floats; ValueError if they, their unit or the density are invalid."""
    times = [float(time) for time in times]
    for time in times:
        if not 0 < time < np.inf:
            raise ValueError(f"time must be positive and finite, got {time!r}")
    if not times:
        raise ValueError("times is empty; at least one time is required")
    if time_unit not in TIME_UNITS:
        raise ValueError(f"time_unit must be one of {', '.join(TIME_UNITS)}, got {time_unit!r}")
    if density not in DENSITIES:
        raise ValueError(f"density must be one of {', '.join(DENSITIES)}, got {density!r}")
    return times


def in_standard_units(times: Sequence[float], time_unit: str, solver: SpectrumSolver) -> list[float]:
    """Times in one of `TIME_UNITS` as standard times on the mesh of area 1."""
    if time_unit == "fiedler":
        return [time / solver.fiedler_value() for time in times]
    return [time * (PAPER_TIME if time_unit == "paper" else 1.0) for time in times]


@cache  # what has been compiled stays so
def compile_ahead() -> None:
    """Compile what `segment` needs, or load it from numba's cache, so that the next call is as fast as all others.

    Examples
    --------
    >>> compile_ahead()
    """
    with sharing_everything():
        segment(*bent_torus(), threads=2)


def bent_torus(n: int = 20) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and faces of a torus without symmetry, too large for the dense eigensolver."""
    i, j = np.divmod(np.arange(n * n), n)
    u, v = 2 * np.pi * i / n, 2 * np.pi * j / n
    ring = 2 + (0.5 + 0.2 * np.sin(u)) * np.cos(v)
    vertices = np.column_stack([1.3 * ring * np.cos(u), ring * np.sin(u), 0.6 * np.sin(v) + 0.3 * np.cos(u)])
    right, up, across = i * n + (j + 1) % n, (i + 1) % n * n + j, (i + 1) % n * n + (j + 1) % n
    corners = np.arange(n * n)
    return vertices, np.vstack([np.column_stack([corners, up, across]), np.column_stack([corners, across, right])])


class Stopwatch:
    """Wall-clock seconds of one stage after the other, and those that compiling took, which belong to no stage."""

    def __init__(self) -> None:
        from heatwalk.numerics.compilation import seconds_compiled  # imports numba

        self.compilation = 0.0
        self._seconds_compiled = seconds_compiled
        self._compiled, self._start = seconds_compiled(), clock.perf_counter()

    def lap(self) -> float:
        """Seconds since the last call, without those that compiling took."""
        compiled, start = self._compiled, self._start
        self._compiled, self._start = self._seconds_compiled(), clock.perf_counter()
        self.compilation += self._compiled - compiled
        return self._start - start - (self._compiled - compiled)


def _segment_at_time(
    faces: NDArray[np.int64],
    spectrum: Spectrum,
    standard_time: float,
    weights: NDArray[np.float64] | None,
    split_dissipators: bool,
    shared_seconds: dict[str, float],
) -> Segmentation:
    """The walk and the dissipators at one time."""
    stopwatch = Stopwatch()
    kernel = HeatKernel.from_spectrum(spectrum, standard_time)
    kernel_seconds = stopwatch.lap()

    walk = heat_walk(kernel)
    walk_seconds = stopwatch.lap()

    excess = relative_entropy_excess(kernel, walk.labels, weights)
    labels = np.where(excess > 0, len(walk.exemplars), walk.labels)
    if split_dissipators:
        labels[excess > 0] += dissipator_pieces(excess > 0, faces)
    dissipator_seconds = stopwatch.lap()

    return Segmentation(
        labels=labels,
        accumulator_labels=walk.labels,
        face_labels=faces_from_vertices(labels, faces),
        exemplars=walk.exemplars,
        relative_entropy_excess=excess,
        walk=walk,
        kernel=kernel,
        spectrum=spectrum,
        time=standard_time / PAPER_TIME,
        standard_time=standard_time,
        fiedler_time=standard_time * spectrum.fiedler_value,
        seconds={
            "compilation": shared_seconds["compilation"] + stopwatch.compilation,
            "operator": shared_seconds["operator"],
            "spectrum": shared_seconds["spectrum"] + kernel_seconds,
            "walk": walk_seconds,
            "dissipators": dissipator_seconds,
        },
        _weights=weights,
    )


def dissipator_pieces(dissipates: NDArray[np.bool_], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The connected piece of each dissipating vertex, numbered 0, 1, 2 …"""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    components = vertex_components(len(dissipates), edges[dissipates[edges].all(axis=1)])
    return np.unique(components[dissipates], return_inverse=True)[1]


def faces_from_vertices(labels: NDArray[np.int64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Transfer labels from vertices to faces: the label of at least two corners, otherwise that of the first corner.

    Parameters
    ----------
    labels : (n,) int array
    faces : (m, 3) int array

    Returns
    -------
    (m,) int array

    Examples
    --------
    >>> faces_from_vertices(np.array([0, 1, 1, 2]), np.array([[0, 1, 2], [0, 1, 3]]))
    array([1, 0])
    """
    a, b, c = labels[faces.T]
    return np.where(b == c, b, a)
