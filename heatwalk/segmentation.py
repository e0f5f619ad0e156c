"""segment(): operator, heat kernel, heat walk, dissipators, in this order; and Segmentation, what they give."""

import time as clock
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from heatwalk.accumulators import HeatWalk, heat_walk
from heatwalk.dissipators import divergence_from_uniform, relative_entropy_excess
from heatwalk.kernel import HeatKernel, largest_eigenvalue
from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from heatwalk.meshes import check_mesh
from heatwalk.spectrum import Spectrum, SpectrumSolver

# Raised when a change of the code changes labels, so that stored results are not taken for those of this version.
ALGORITHM_VERSION = 1

# The paper's time 1 on a mesh of area 1, in units of the heat equation ∂u/∂t = Δu: its operator is Δ/6.
PAPER_TIME = 1 / 6

TIME_UNITS = ("paper", "standard", "fiedler")
DENSITIES = ("vertices", "area")


@dataclass(frozen=True)
class Segmentation:
    """What the Heat Walk makes of a mesh with n vertices and m faces.

    Attributes
    ----------
    labels : (n,) int array
        0 … K-1 the accumulator regions, K the dissipator region (K, K+1 … its connected pieces with
        ``split_dissipators``). A region all of whose vertices dissipate keeps its number and has no vertex.
    accumulator_labels : (n,) int array, 0 … K-1, the regions before the dissipator step
    face_labels : (m,) int array
        ``labels`` carried to the faces: the label that two corners agree on, else the first corner's
    exemplars : (K,) int array, ascending; the vertex that each accumulator region walked to
    relative_entropy_excess : (n,) float array
        KL(p_x ‖ q_C) − KL(p_x ‖ uniform) in nats; the vertex dissipates where it is positive
    walk : HeatWalk, the forest of the walk and its history
    kernel : HeatKernel
    spectrum : Spectrum
    time : float, in the paper's units, on the mesh scaled to area 1
    standard_time : float, ``time / 6``, in units of the heat equation ∂u/∂t = Δu
    fiedler_time : float, standard time times the smallest positive eigenvalue: without a unit, whatever the area
    seconds : dict of the seconds each stage took: operator (with the mesh's check), spectrum, walk, dissipators
    """

    labels: np.ndarray
    accumulator_labels: np.ndarray
    face_labels: np.ndarray
    exemplars: np.ndarray
    relative_entropy_excess: np.ndarray
    walk: HeatWalk
    kernel: HeatKernel
    spectrum: Spectrum
    time: float
    standard_time: float
    fiedler_time: float
    seconds: dict = field(compare=False)
    _weights: np.ndarray | None = field(repr=False, default=None)

    @property
    def n_components(self):
        """Connected components of the mesh; each holds at least one region."""
        return len(self.spectrum.eigenvalues)

    @property
    def n_segments(self):
        """Labels that at least one vertex carries, the dissipator region included."""
        return len(np.unique(self.labels))

    @property
    def dissipates(self):
        """(n,) bool array, the vertices of the dissipator region."""
        return self.relative_entropy_excess > 0

    @cached_property
    def divergence_from_uniform(self):
        """KL(p_x ‖ uniform): (n,) float array, in nats (paper, Figure 4 b). O(n²) time when first asked for."""
        return divergence_from_uniform(self.kernel, self._weights)

    @property
    def divergence_from_region(self):
        """KL(p_x ‖ q_C), C the region of x: (n,) float array, in nats (paper, Figure 4 c)."""
        return self.divergence_from_uniform + self.relative_entropy_excess


def segment(vertices, faces, time=1.0, *, time_unit="paper", density="vertices", split_dissipators=False):
    """Segment a triangle mesh with the Heat Walk.

    Parameters
    ----------
    vertices : (n, 3) array of coordinates, in any unit
    faces : (m, 3) array of vertex indices
    time : float
        how long heat flows, by default in the paper's units; the paper uses 1 throughout
    time_unit : {"paper", "standard", "fiedler"}
        "standard": ∂u/∂t = Δu on the mesh of area 1, six times the paper's; "fiedler": multiples of 1/λ₁, the
        smallest positive eigenvalue
    density : {"vertices", "area"}
        whether heat densities are sums over vertices, as the paper prints them, or integrals over the surface
    split_dissipators : bool
        give each connected piece of the dissipator region a label of its own

    Returns
    -------
    Segmentation

    Raises
    ------
    MeshError
        (a ValueError) for a mesh that cannot be segmented
    SpectrumError
        when the eigensolver does not reach its residual
    ValueError
        for a time that is not positive, or an unknown option

    Notes
    -----
    The mesh is scaled to area 1, the area of all its components together. Heat does not cross from one component to
    another, so that each holds regions of its own; the uniform density of the dissipator test is over all n vertices.

    Source: Benjamin, Polk, Vishwanathan, Ramani, "Heat Walk: Robust Salient Segmentation of Non-rigid Shapes", 2011.
    """
    options = {"time_unit": time_unit, "density": density, "split_dissipators": split_dissipators}
    return next(segment_at_times(vertices, faces, [time], **options))


def segment_at_times(vertices, faces, times, *, time_unit="paper", density="vertices", split_dissipators=False):
    """Segment a triangle mesh with the Heat Walk at many times, from one spectrum: that of the shortest.

    Parameters
    ----------
    times : sequence of floats, in any order; the other parameters are those of ``segment``

    Returns
    -------
    iterator of Segmentation, one a time, in the order of ``times``; the same labels as ``segment`` gives. Each is made
    when it is asked for; the mesh is checked and its spectrum computed at the call. The ``seconds`` of each count the
    operator and the spectrum in full, though they are shared.

    Raises
    ------
    as ``segment``
    """
    times = [float(time) for time in times]
    for time in times:
        if not 0 < time < np.inf:
            raise ValueError(f"time must be positive and finite, not {time!r}")
    if not times:
        raise ValueError("times is empty; at least one is needed")
    if time_unit not in TIME_UNITS:
        raise ValueError(f"time_unit must be one of {', '.join(TIME_UNITS)}, not {time_unit!r}")
    if density not in DENSITIES:
        raise ValueError(f"density must be one of {', '.join(DENSITIES)}, not {density!r}")

    start = clock.perf_counter()
    vertices, faces = check_mesh(vertices, faces)
    stiffness, mass = stiffness_and_mass(unit_area(vertices, faces), faces)
    component = vertex_components(len(vertices), faces)
    assembled = clock.perf_counter()

    solver = SpectrumSolver(stiffness, mass, component)
    del stiffness
    if time_unit == "fiedler":
        standard_times = [time / solver.fiedler_value() for time in times]
    else:
        standard_times = [time * (PAPER_TIME if time_unit == "paper" else 1.0) for time in times]
    spectrum = solver.up_to(largest_eigenvalue(min(standard_times)))
    del solver  # the factors are larger than all that follows
    shared = {"operator": assembled - start, "spectrum": clock.perf_counter() - assembled}
    weights = mass if density == "area" else None
    return (_at_time(faces, spectrum, time, weights, split_dissipators, shared) for time in standard_times)


def _at_time(faces, spectrum, standard_time, weights, split_dissipators, shared):
    """The walk and the dissipators at one time: Segmentation."""
    marks = [clock.perf_counter()]
    kernel = HeatKernel.from_spectrum(spectrum, standard_time)
    marks.append(clock.perf_counter())

    walk = heat_walk(kernel)
    marks.append(clock.perf_counter())

    excess = relative_entropy_excess(kernel, walk.labels, weights)
    labels = np.where(excess > 0, len(walk.exemplars), walk.labels)
    if split_dissipators:
        edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        pieces = vertex_components(len(labels), edges[(excess[edges] > 0).all(axis=1)])[excess > 0]
        labels[excess > 0] += np.unique(pieces, return_inverse=True)[1]
    marks.append(clock.perf_counter())
    for_kernel, for_walk, for_dissipators = np.diff(marks).tolist()

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
            "operator": shared["operator"],
            "spectrum": shared["spectrum"] + for_kernel,
            "walk": for_walk,
            "dissipators": for_dissipators,
        },
        _weights=weights,
    )


def faces_from_vertices(labels, faces):
    """Labels of vertices carried to the faces: the label that two corners agree on, else the first corner's.

    Parameters
    ----------
    labels : (n,) int array
    faces : (m, 3) int array

    Returns
    -------
    (m,) int array
    """
    a, b, c = labels[faces.T]
    return np.where(b == c, b, a)
