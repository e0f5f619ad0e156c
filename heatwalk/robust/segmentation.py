"""The robust variant: the walk with an averaged kernel at a stable time, its regions joined by persistence."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import heatwalk.kernel
from heatwalk.accumulators import heat_walk
from heatwalk.confidence import dissipator_margin, walk_margin
from heatwalk.dissipators import relative_entropy_excess
from heatwalk.kernel import largest_eigenvalue
from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from heatwalk.meshes import check_mesh, mesh_edges, without_repeated_faces
from heatwalk.numerics.threads import one_blas_thread, sharing_everything, with_threads, working_threads
from heatwalk.robust import scale
from heatwalk.robust.averaging import averaged_kernel
from heatwalk.robust.cuts import CutGraph
from heatwalk.robust.merging import Merging, merge_regions, saddles_between
from heatwalk.robust.options import Options
from heatwalk.robust.parts import Parts, find_parts
from heatwalk.robust.repair import Repaired, repaired
from heatwalk.robust.scale import stable_time
from heatwalk.robust.stitching import Stitched, stitch_borders
from heatwalk.segmentation import (
    PAPER_TIME,
    Segmentation,
    Stopwatch,
    bent_torus,
    check_times,
    dissipator_pieces,
    faces_from_vertices,
    in_standard_units,
)
from heatwalk.spectrum import Spectrum, SpectrumSolver

# Increased when a change of the code changes labels, so that stored results of older versions are not reused.
ROBUST_VERSION = 5

# Least weight of an eigenvalue in the averaged kernel: labels are those of all smaller values too.
MIN_DECAY = 1e-6

# Largest accepted residual of an eigenpair: a hundred times that of the walk as published, as crumpled meshes can have
# flat triangles that exceed it by little, and the averaged kernel omits more than this.
MAX_RESIDUAL = 1e-6


@dataclass(frozen=True)
class RobustSegmentation(Segmentation):
    """Result of `heatwalk.segment_robust`, a `heatwalk.Segmentation` whose regions are joined ones.

    Attributes
    ----------
    labels, accumulator_labels, face_labels, exemplars, relative_entropy_excess
        as of `heatwalk.Segmentation`, for the joined regions
    walk : HeatWalk
        its ``labels`` and ``exemplars`` are those of the regions before they were joined
    time, standard_time, fiedler_time : float
        the time that was chosen; the kernel is averaged over ``times`` around it
    times : (m,) float array
        standard times
    requested_time : float
        the time that was asked for, in the units of the paper
    merging : Merging
        which regions of ``walk`` are joined
    repaired : Repaired
        the mesh that was measured: ``kernel``, ``spectrum`` and ``walk`` refer to its vertices
    number : (n,) int array
        which of these each vertex is: the i-th is the i-th, unless borders were stitched
    source : (n,) int array
        which of these has the label of each vertex: ``number``, unless it is on a speck
    options : Options
    """

    times: NDArray[np.float64] = field(kw_only=True)
    requested_time: float = field(kw_only=True)
    merging: Merging = field(kw_only=True)
    repaired: Repaired = field(kw_only=True)
    number: NDArray[np.int64] = field(kw_only=True)
    source: NDArray[np.int64] = field(kw_only=True)
    parts: Parts | None = field(kw_only=True)
    options: Options = field(kw_only=True)

    @property
    def dissipates(self) -> NDArray[np.bool_]:
        """Whether each vertex is in the dissipator region, or with ``parts`` in the trunk: (n,) bool array."""
        return self.labels >= len(self.exemplars)

    @cached_property
    @one_blas_thread()
    def margin(self) -> NDArray[np.float64]:
        """How far the label of each vertex is from another one: (n,) float array in [0, 1], 0 if another ties with it.

        The smallest of the margins of all decisions that lead to the label: of the walk and of the dissipator test, see
        `heatwalk.confidence`, and of those about joining its region; with ``parts``, of the latter and of the cuts.
        """
        if self.parts is not None:
            return np.minimum(self.merging.margin[self.walk.labels], self.parts.margin)[self.source]
        joined = self.merging.of_region[self.walk.labels]
        of_walk = np.minimum(walk_margin(self.kernel, self.walk, joined), self.merging.margin[self.walk.labels])
        of_test = dissipator_margin(self.relative_entropy_excess)
        return np.where(self.dissipates, of_test, np.minimum(of_test, of_walk[self.source]))

    @cached_property
    def divergence_from_uniform(self) -> NDArray[np.float64]:
        """KL(p_x ‖ uniform), (n,) float array in nats, on the repaired mesh; O(n²) time on first access."""
        return super().divergence_from_uniform[self.number]


def segment_robust(
    vertices: ArrayLike,
    faces: ArrayLike,
    time: float = 1.0,
    *,
    time_unit: str = "paper",
    density: str = "area",
    split_dissipators: bool = False,
    options: Options = Options(),  # noqa: B008 (frozen)
    threads: int | None = None,
) -> RobustSegmentation:
    """Segment a triangle mesh with the robust variant of the Heat Walk.

    Parameters
    ----------
    vertices, faces, time_unit, split_dissipators, threads
        as in `heatwalk.segment`
    density : {"vertices", "area"}
        "area": the divergences of the dissipator test and the mean density of a region are integrals over the surface;
        in sums over vertices, the many vertices of a thin tip or a crumpled spot weigh as much as a limb. "vertices":
        sums, as published
    time : float
        duration of the heat flow: with ``options.choose_time`` the middle of the times of which one is chosen
    options : Options
        which of the following are used, and their parameters

    Returns
    -------
    RobustSegmentation

    Raises
    ------
    MeshError, SpectrumError, ValueError
        as `heatwalk.segment`

    Notes
    -----
    The parts, in the order in which they are applied:

    - ``repair``: `heatwalk.robust.repair`. Only lengths and angles are measured on the repaired mesh.
    - ``choose_time``: `heatwalk.robust.scale`
    - ``average``: `heatwalk.robust.averaging`. The theorem of the walk holds for the averaged kernel.
    - ``merge``, ``join_small``: `heatwalk.robust.merging`. A connected component that is too small to be a region takes
      the label of the nearest vertex of the others.
    - ``refine``, ``hierarchy``: `heatwalk.robust.parts`; off by default, because borders at creases and the number of
      waists are less stable than regions of heat. Then ``exemplars`` has one vertex per part, and the trunk has the
      label of the dissipator region.

    With all of them off, and sums over vertices, labels are those of `heatwalk.segment`. So ``time`` 1 is 1/6 in
    standard units here, too.

    Examples
    --------
    >>> import trimesh
    >>> mesh = trimesh.creation.icosphere(3).apply_scale([4, 1.2, 1])
    >>> seg = segment_robust(mesh.vertices, mesh.faces)
    >>> seg.n_segments, len(seg.exemplars)
    (3, 2)
    >>> bool(((seg.margin >= 0) & (seg.margin <= 1)).all())
    True
    """
    return next(
        segment_robust_at_times(
            vertices,
            faces,
            [time],
            time_unit=time_unit,
            density=density,
            split_dissipators=split_dissipators,
            options=options,
            threads=threads,
        )
    )


def segment_robust_at_times(
    vertices: ArrayLike,
    faces: ArrayLike,
    times: Sequence[float],
    *,
    time_unit: str = "paper",
    density: str = "area",
    split_dissipators: bool = False,
    options: Options = Options(),  # noqa: B008 (frozen)
    threads: int | None = None,
) -> Iterator[RobustSegmentation]:
    """Segment a triangle mesh with the robust variant at several times, from a single spectrum.

    Parameters
    ----------
    vertices, faces, time_unit, density, split_dissipators, options, threads
        as in `segment_robust`
    times : sequence of floats, in any order

    Returns
    -------
    iterator of RobustSegmentation
        one per time, as of `heatwalk.segment_at_times`

    Raises
    ------
    MeshError, SpectrumError, ValueError
        as `segment_robust`; also ValueError if ``times`` is empty

    Examples
    --------
    The number of segments hardly depends on the time:

    >>> import trimesh
    >>> mesh = trimesh.creation.icosphere(3).apply_scale([4, 1.2, 1])
    >>> [seg.n_segments for seg in segment_robust_at_times(mesh.vertices, mesh.faces, [0.6, 1, 2.7])]
    [3, 3, 3]
    """
    times = check_times(times, time_unit, density)
    with working_threads(threads):
        stopwatch = Stopwatch()
        vertices, faces = check_mesh(vertices, faces)
        stitched = (stitch_borders if options.repair.stitch else Stitched.unchanged)(vertices, faces)
        surface = without_repeated_faces(stitched.faces)
        seconds = {"operator": stopwatch.lap()}

        metric = repaired(vertices[stitched.origin], surface, options.repair)
        seconds["repair"] = stopwatch.lap()

        stiffness, mass = stiffness_and_mass(unit_area(metric.vertices, metric.faces), metric.faces)
        component = vertex_components(len(metric.vertices), metric.faces)
        edges = mesh_edges(metric.faces)[0]
        seconds["operator"] += stopwatch.lap()

        solver = SpectrumSolver(stiffness, mass, component, MAX_RESIDUAL)
        del stiffness
        standard_times = in_standard_units(times, time_unit, solver)
        spectrum = solver.up_to(max(_largest_eigenvalues(min(standard_times), options)))
        seconds["spectrum"] = stopwatch.lap()
        chosen = standard_times
        if options.choose_time:
            chosen = [stable_time(spectrum, edges, time, options) for time in standard_times]
        seconds["time"] = stopwatch.lap()
        if (limit := largest_eigenvalue(options.averaged(min(chosen))[0], _min_decay(options))) > spectrum.limit:
            spectrum = solver.up_to(limit)
        del solver  # the factor is larger than everything that follows
        seconds["spectrum"] += stopwatch.lap()
        seconds["compilation"] = stopwatch.compilation
    shared = _Shared(
        faces,
        stitched,
        metric,
        edges,
        spectrum,
        mass if density == "area" else None,
        _cut_graph(metric, mass, options),
        split_dissipators,
        options,
        seconds,
    )
    return (
        with_threads(threads, _segment_at_time, shared, time, requested)
        for time, requested in zip(chosen, standard_times, strict=True)
    )


@cache  # what has been compiled stays so
def compile_ahead() -> None:
    """Compile what `segment_robust` needs, or load it from numba's cache, as `heatwalk.segmentation.compile_ahead`.

    Examples
    --------
    >>> compile_ahead()
    """
    vertices, faces = bent_torus()
    vertices[100] *= 1.5  # a spike, and two holes: one triangle, and all around a vertex but one
    missing = np.flatnonzero((faces == 250).any(axis=1))[1:]
    with sharing_everything():
        segment_robust(vertices, np.delete(faces, [0, *missing], axis=0), threads=2)


class _Shared(NamedTuple):
    """What segmentations at several times have in common."""

    faces: NDArray[np.int64]
    stitched: Stitched
    metric: Repaired
    edges: NDArray[np.int64]
    spectrum: Spectrum
    weights: NDArray[np.float64] | None
    graph: CutGraph | None
    split_dissipators: bool
    options: Options
    seconds: dict[str, float]


def _cut_graph(metric: Repaired, mass: NDArray[np.float64], options: Options) -> CutGraph | None:
    """What cuts cost; None if there are none."""
    if not (options.refine or options.hierarchy):
        return None
    return CutGraph.of(metric.vertices, metric.faces, mass, options.max_curvature)


def _around_trunk(
    parts: Parts, regions: NDArray[np.int64], mass: NDArray[np.float64], potential: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The part of each vertex, in the trunk that in which most of its region is; and the exemplar of each part."""
    n_parts = len(parts.parents)
    is_trunk = parts.labels == n_parts
    share = np.zeros((int(regions.max()) + 1, n_parts))
    np.add.at(share, (regions[~is_trunk], parts.labels[~is_trunk]), mass[~is_trunk])
    labels = np.where(is_trunk, share.argmax(axis=1)[regions], parts.labels)
    order = np.lexsort((np.arange(len(labels)), -potential, is_trunk, labels))
    return labels, order[np.unique(labels[order], return_index=True)[1]]


def _largest_eigenvalues(time: float, options: Options) -> tuple[float, float]:
    """The eigenvalues up to which the walk at a standard time, and the choice of the time require the spectrum."""
    first = options.averaged(time)[0]
    of_walk = largest_eigenvalue(first, _min_decay(options))
    if not options.choose_time:
        return of_walk, of_walk
    shortest = first / 2 ** (options.octaves_before + 1 / scale.PER_OCTAVE)
    return of_walk, largest_eigenvalue(shortest, scale.MIN_DECAY)


def _min_decay(options: Options) -> float:
    """Least weight of an eigenvalue in the kernel."""
    return MIN_DECAY if options.average else heatwalk.kernel.MIN_DECAY


def _segment_at_time(shared: _Shared, time: float, requested: float) -> RobustSegmentation:
    """The walk, the joined regions and the dissipators at a standard time."""
    stopwatch = Stopwatch()
    options, spectrum, n_vertices = shared.options, shared.spectrum, len(shared.stitched.origin)
    times = options.averaged(time)
    kernel = averaged_kernel(spectrum, times, _min_decay(options))
    kernel_seconds = stopwatch.lap()

    walk = heat_walk(kernel)
    walk_seconds = stopwatch.lap()

    merging = merge_regions(
        saddles_between(kernel, walk.labels, shared.edges),
        walk.exemplars,
        walk.first_potential[walk.exemplars],
        np.bincount(walk.labels, spectrum.mass).astype(np.float64),
        **options.joining,
    )
    joined = merging.of_region[walk.labels]
    merging_seconds = stopwatch.lap()

    excess = relative_entropy_excess(kernel, joined, shared.weights, shared.weights)
    dissipates = excess > 0
    dissipator_seconds = {"dissipators": stopwatch.lap()}

    parts = None
    source = _sources(shared.metric.vertices, joined, spectrum.mass, n_vertices, options)
    peaks = merging.exemplars
    if shared.graph is not None:
        parts = find_parts(shared.graph, spectrum, joined, peaks, excess, time, **options.cutting)
        joined, peaks = _around_trunk(parts, joined, spectrum.mass, walk.first_potential)
        dissipates = parts.labels == len(parts.parents)
        dissipator_seconds["parts"] = stopwatch.lap()
    joined, excess, dissipates = joined[source], excess[source], dissipates[source]
    exemplars, accumulator_labels = _at_vertices(joined, peaks, walk.first_potential[:n_vertices])
    exemplars, number = shared.stitched.origin[exemplars], shared.stitched.number
    accumulator_labels, excess, dissipates = accumulator_labels[number], excess[number], dissipates[number]
    labels = np.where(dissipates, len(exemplars), accumulator_labels)
    if shared.split_dissipators:
        labels[dissipates] += dissipator_pieces(dissipates, shared.faces)
    dissipator_seconds["dissipators"] += stopwatch.lap()

    return RobustSegmentation(
        labels=labels,
        accumulator_labels=accumulator_labels,
        face_labels=faces_from_vertices(labels, shared.faces),
        exemplars=exemplars,
        relative_entropy_excess=excess,
        walk=walk,
        kernel=kernel,
        spectrum=spectrum,
        time=time / PAPER_TIME,
        standard_time=time,
        fiedler_time=time * spectrum.fiedler_value,
        seconds={
            "compilation": shared.seconds["compilation"] + stopwatch.compilation,
            "operator": shared.seconds["operator"],
            "repair": shared.seconds["repair"],
            "spectrum": shared.seconds["spectrum"] + kernel_seconds,
            "time": shared.seconds["time"],
            "walk": walk_seconds,
            "merging": merging_seconds,
            **dissipator_seconds,
        },
        _weights=shared.weights,
        times=times,
        requested_time=requested / PAPER_TIME,
        merging=merging,
        repaired=shared.metric,
        number=number,
        source=source[number],
        parts=parts,
        options=options,
    )


def _sources(
    vertices: NDArray[np.float64],
    labels: NDArray[np.int64],
    mass: NDArray[np.float64],
    n_vertices: int,
    options: Options,
) -> NDArray[np.int64]:
    """The vertex whose label each of the first ``n_vertices`` takes: the nearest one not on a speck.

    A speck is a region that is too small and has no neighbour to be joined to: a connected component.
    """
    source = np.arange(n_vertices)
    areas = np.bincount(labels, mass)
    is_speck = (areas < options.joining["min_area"] * areas.sum())[labels[:n_vertices]]
    if is_speck.any() and not is_speck.all():
        from scipy.spatial import KDTree

        others = source[~is_speck]
        source[is_speck] = others[KDTree(vertices[others]).query(vertices[:n_vertices][is_speck])[1]]
    return source


def _at_vertices(
    labels: NDArray[np.int64], exemplars: NDArray[np.int64], potential: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Regions restricted to the vertices of the mesh itself: exemplars, ascending, and labels.

    Of a region whose exemplar was added by a repair it is the vertex of the highest potential.
    """
    n_vertices = len(labels)
    order = np.lexsort((np.arange(n_vertices), -potential, labels))
    present, first = np.unique(labels[order], return_index=True)
    own = np.where(exemplars[present] < n_vertices, exemplars[present], order[first])
    rank = np.empty(len(exemplars), dtype=np.int64)
    rank[present[np.argsort(own)]] = np.arange(len(own))
    return np.sort(own), rank[labels]
