"""Parts bounded by narrow and concave cuts, around the regions of the walk and within them.

The walk and the dissipator test say which limbs there are, and hardly where a limb ends: heat does not feel a crease.
And a limb is one region, of which people see several parts: a hand, a forearm, an upper arm. Both is told by what it
costs to cut the surface at each place between the tip of a limb, the exemplar of its region, and the rest:

    for each region, of exemplar e:
        g = potential of a source of heat at e that is balanced by an equal loss all over the surface
        profile(a) = cost of cutting off the part of area a where g is largest, for every a
    border (`refine`):
        the cheapest cut between the half of the limb that is nearest to its tip
        and the middle of the dissipators, and the same halves of the other limbs
    waists (`hierarchy`):
        for each minimum of the profile, which is exceeded on both sides by a given factor before a lower one is met:
        the cheapest cut between the maxima on both sides, up to which no other such minimum is met
    of all cuts, the most prominent first: those that enclose, are enclosed by, or are disjoint from those before

so that the cuts form a tree; a part is what lies in a cut and in no cut within it. What lies in none is the trunk. The
level sets of g enclose the tip, as g has no other maximum; that its cuts are where the profile has persistent minima
(by the topological persistence of a function of one variable) makes the number of parts a matter of how narrow a
waist has to be, and of no number that has to be told.

References
----------
H. Edelsbrunner, D. Letscher, A. Zomorodian, "Topological persistence and simplification", Discrete & Computational
Geometry 28, 2002, doi:10.1007/s00454-002-2885-2; S. Katz, G. Leifman, A. Tal, "Mesh segmentation using feature point
and core extraction", The Visual Computer 21, 2005, doi:10.1007/s00371-005-0344-9
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.robust.cuts import CutGraph, level_costs, minimum_cut
from heatwalk.spectrum import Spectrum

# Area between two cuts of a profile, as a share of the area of the mesh.
STEP = 0.002

# The share of a limb, from its tip on, that its border encloses at least; and the share of the area of the mesh that
# most dissipates, which it never does.
INNER_SHARE = 0.5
CENTRE_SHARE = 0.01

# The source of heat is a spot that heat reaches in this share of the time of the walk.
SPOT = 1 / 16

# Two cuts of which the smaller one has less than this share of its area outside the other one count as nested; with
# less than this share of it inside, as disjoint.
OVERLAP = 0.1

# Area between the border of a limb and a waist, as a share of the mesh, up to which they are the same cut.
SAME_CUT = 0.02

# Largest part that a waist cuts off, as a share of the area of the mesh.
MAX_SHARE = 0.6


@dataclass(frozen=True)
class Parts:
    """Parts of a mesh with n vertices.

    Attributes
    ----------
    labels : (n,) int array
        0 … J-1 the part of each vertex, J the trunk
    parents : (J,) int array
        the part whose cut encloses that of each part most closely, J if that of none does
    margin : (n,) float array
        how far the cuts are from being elsewhere, in [0, 1]: the share by which the profile exceeds its value at the
        cut on the way from there to the vertex, least over all cuts
    """

    labels: NDArray[np.int64]
    parents: NDArray[np.int64]
    margin: NDArray[np.float64]


class Profile(NamedTuple):
    """What it costs to cut off the vertices around a tip, along level sets.

    ``order`` are the vertices from the tip on, ``ends[i]`` how many the i-th cut encloses, ``costs[i]`` its cost.
    """

    order: NDArray[np.int64]
    ends: NDArray[np.int64]
    costs: NDArray[np.float64]


class Waist(NamedTuple):
    """A minimum of a profile: its index, those of the maxima towards the next minima, and by what factor it is lower.

    The factor is that by which the profile exceeds the minimum on both sides, before a lower value or an end is met.
    """

    at: int
    before: int
    behind: int
    prominence: float


class _Cut(NamedTuple):
    """Vertices that a cut encloses, their area, what decides if it is in the way of another, and its place."""

    inside: NDArray[np.bool_]
    area: float
    prominence: float
    profile: Profile


def find_parts(
    graph: CutGraph,
    spectrum: Spectrum,
    regions: NDArray[np.int64],
    exemplars: NDArray[np.int64],
    excess: NDArray[np.float64],
    time: float,
    *,
    refine: bool,
    hierarchy: bool,
    prominence: float,
    min_area: float,
) -> Parts:
    """Cut a mesh into parts.

    Parameters
    ----------
    graph : CutGraph
        of n vertices
    spectrum : Spectrum
    regions : (n,) int array, 0 … K-1
        accumulator regions
    exemplars : (K,) int array
        a vertex of each
    excess : (n,) float array
        of the dissipator test: above 0 for vertices that are in no limb
    time : float
        standard time of the walk
    refine : bool
        move the border of each limb to the cheapest cut
    hierarchy : bool
        cut limbs at their waists
    prominence : float, above 1
        how many times as expensive as at a waist a cut has to be on both sides of it
    min_area : float
        least area of a part, as a share of the mesh

    Returns
    -------
    Parts
    """
    profiles = [_profile(graph, spectrum, exemplars, region, time) for region in range(len(exemplars))]
    limbs = np.where(excess > 0, len(exemplars), regions)
    cuts = _waists(graph, profiles, prominence, min_area) if hierarchy else []
    cuts += _borders(graph, profiles, limbs, excess, spectrum.component, refine)
    return _parts(graph, _laminar(cuts, graph.areas, min_area), prominence, min_area)


def potential(spectrum: Spectrum, vertex: int, time: float) -> NDArray[np.float64]:
    """Stationary potential of a source of heat, balanced by an equal loss all over its component.

    Parameters
    ----------
    spectrum : Spectrum
        of n vertices
    vertex : int
        the source, spread over the spot that heat reaches in ``time``
    time : float
        standard time

    Returns
    -------
    (n,) float array
        of mean 0; -inf on other components

    Examples
    --------
    >>> spectrum = Spectrum(
    ...     np.array([[0.0, 2.0]]), np.array([[1.0, 1], [1, -1]]), np.zeros(2, int), np.array([0.5, 0.5]), 9.0, 0.0
    ... )
    >>> potential(spectrum, 0, time=0.0)
    array([ 0.5, -0.5])
    """
    own = spectrum.component[vertex]
    values = spectrum.eigenvalues[own]
    used = np.isfinite(values)
    used[0] = False
    weights = np.exp(-values[used] * time) / values[used]
    result = spectrum.eigenvectors[:, used] @ (weights * spectrum.eigenvectors[vertex, used])
    return np.where(spectrum.component == own, result, -np.inf)


def waists(costs: NDArray[np.float64], prominence: float) -> list[Waist]:
    """The minima of a profile that are exceeded by a factor on both sides, before a lower value or an end is met.

    Parameters
    ----------
    costs : (k,) float array
    prominence : float, above 1

    Returns
    -------
    list of Waist, ascending

    Examples
    --------
    >>> waists(np.array([0, 3, 2, 2.2, 1, 6, 5]), 1.2)
    [Waist(at=4, before=1, behind=5, prominence=3.0)]
    """
    found = []
    for at in range(1, len(costs) - 1):
        if costs[at] > costs[at - 1] or costs[at] >= costs[at + 1]:
            continue
        lower = np.flatnonzero(costs < costs[at])
        first, last = lower[lower < at].max(initial=-1) + 1, lower[lower > at].min(initial=len(costs))
        barrier = min(costs[first:at].max(), costs[at + 1 : last].max())
        if barrier >= prominence * costs[at]:
            found.append((at, barrier / max(costs[at], np.finfo(float).tiny)))
    ends = [0, *(at for at, _ in found), len(costs) - 1]
    return [
        Waist(
            at,
            ends[i] + int(costs[ends[i] : at].argmax()),
            at + 1 + int(costs[at + 1 : ends[i + 2] + 1].argmax()),
            float(ratio),
        )
        for i, (at, ratio) in enumerate(found)
    ]


def _profile(graph: CutGraph, spectrum: Spectrum, exemplars: NDArray[np.int64], region: int, time: float) -> Profile:
    """The profile of the cuts around the tip of a region, up to the first tip of another one."""
    g = potential(spectrum, int(exemplars[region]), time * SPOT)
    inside = np.flatnonzero(g > np.delete(g[exemplars], region).max(initial=-np.inf))
    order = inside[np.argsort(-g[inside], kind="stable")]
    areas = np.cumsum(graph.areas[order]) / graph.areas.sum()
    ends = np.unique(np.searchsorted(areas, np.arange(STEP, areas[-1], STEP))) + 1
    ends = ends[ends < len(order)]
    return Profile(order, ends, level_costs(graph, g, (g[order[ends - 1]] + g[order[ends]]) / 2))


def _waists(graph: CutGraph, profiles: list[Profile], prominence: float, min_area: float) -> list[_Cut]:
    """The cheapest cut around every waist of every limb."""
    n, total = len(graph.areas), graph.areas.sum()
    cuts = []
    for profile in profiles:
        share = np.cumsum(graph.areas[profile.order]) / total
        for waist in waists(profile.costs, prominence):
            if not min_area <= share[profile.ends[waist.at] - 1] <= MAX_SHARE:
                continue
            source, sink = np.zeros(n, bool), np.ones(n, bool)
            source[profile.order[: profile.ends[waist.before]]] = True
            sink[profile.order[: profile.ends[waist.behind] - 1]] = False
            inside = minimum_cut(graph, source, sink & ~source)
            cuts.append(_Cut(inside, float(graph.areas[inside].sum()), waist.prominence, profile))
    return cuts


def _borders(
    graph: CutGraph,
    profiles: list[Profile],
    limbs: NDArray[np.int64],
    excess: NDArray[np.float64],
    component: NDArray[np.int64],
    refine: bool,
) -> list[_Cut]:
    """The border of every limb: as the dissipator test has it, or the cheapest cut."""
    n_regions = len(profiles)
    inner = np.full(len(limbs), -1)
    for region, profile in enumerate(profiles):
        order = profile.order[limbs[profile.order] == region]
        inner[_first_share(order, graph.areas, INNER_SHARE * graph.areas[limbs == region].sum())] = region
    dissipators = np.flatnonzero(limbs == n_regions)
    centre = np.zeros(len(limbs), bool)
    order = dissipators[np.argsort(-excess[dissipators], kind="stable")]
    centre[_first_share(order, graph.areas, CENTRE_SHARE * graph.areas.sum())] = True
    cuts = []
    for region, profile in enumerate(profiles):
        inside = limbs == region
        source, sink = inner == region, centre | (inner >= 0) & (inner != region)
        if refine and source.any() and sink[component == component[source.argmax()]].any():
            inside = minimum_cut(graph, source, sink)
        cuts.append(_Cut(inside, float(graph.areas[inside].sum()), 0.0, profile))
    return cuts


def _first_share(order: NDArray[np.int64], areas: NDArray[np.float64], area: float) -> NDArray[np.int64]:
    """The first vertices of an order whose areas sum up to at most an area, and at least one of them."""
    return order[: max(int(np.searchsorted(np.cumsum(areas[order]), area, side="right")), 1)]


def _laminar(cuts: list[_Cut], areas: NDArray[np.float64], min_area: float) -> list[_Cut]:
    """Cuts of which any two are nested or disjoint, the most prominent ones of all; the largest first."""
    total = areas.sum()
    chosen: list[_Cut] = []
    for cut in sorted(cuts, key=lambda cut: -cut.prominence):
        if cut.prominence > 0 and cut.area < min_area * total:
            continue
        apart = (min_area if cut.prominence > 0 else SAME_CUT) * total
        for other in chosen:
            common, smaller = areas[cut.inside & other.inside].sum(), min(cut.area, other.area)
            is_nested = common >= (1 - OVERLAP) * smaller
            if common > OVERLAP * smaller and not (is_nested and abs(cut.area - other.area) >= apart):
                break
        else:
            chosen.append(cut)
    return sorted(chosen, key=lambda cut: -cut.area)


def _parts(graph: CutGraph, cuts: list[_Cut], prominence: float, min_area: float) -> Parts:
    """What each cut encloses and no other within it, without scraps."""
    labels = np.full(len(graph.areas), len(cuts))
    parents = np.full(len(cuts), len(cuts))
    margin = np.ones(len(labels))
    for part, cut in enumerate(cuts):
        around = labels[cut.inside]
        parents[part] = (
            np.bincount(around, graph.areas[cut.inside], len(cuts) + 1).argmax() if len(around) else len(cuts)
        )
        labels[cut.inside] = part
    for part, cut in enumerate(cuts):
        np.minimum(margin, _margin_at(cut, graph.areas, len(labels)), out=margin)
        if cut.prominence > 0:
            own = labels == part
            margin[own] = np.minimum(margin[own], 1 - prominence / cut.prominence)
    labels = _without_scraps(graph, labels, len(cuts), min_area / 2 * graph.areas.sum())
    present = np.unique(labels[labels < len(cuts)])
    number = np.full(len(cuts) + 1, len(present))
    number[present] = np.arange(len(present))
    for part in range(len(cuts)):  # an enclosing cut comes first
        while parents[part] < len(cuts) and number[parents[part]] == len(present):
            parents[part] = parents[parents[part]]
    return Parts(number[labels], number[parents[present]], margin)


def _margin_at(cut: _Cut, areas: NDArray[np.float64], n_vertices: int) -> NDArray[np.float64]:
    """The share by which the profile exceeds its value at a cut on the way from there to each vertex: (n,)."""
    order, ends, costs = cut.profile
    margin = np.ones(n_vertices)
    if not len(ends):
        return margin
    at = int(np.searchsorted(np.cumsum(areas[order])[ends - 1], cut.area * (1 - 1e-9)).clip(0, len(ends) - 1))
    highest = np.concatenate([np.maximum.accumulate(costs[at::-1])[::-1], np.maximum.accumulate(costs[at:])[1:]])
    of_step = 1 - costs[at] / np.maximum(highest, np.finfo(float).tiny)
    step = np.searchsorted(ends, np.arange(len(order)), side="right").clip(0, len(ends) - 1)
    margin[order] = of_step[step]
    return margin


def _without_scraps(graph: CutGraph, labels: NDArray[np.int64], trunk: int, least_area: float) -> NDArray[np.int64]:
    """Labels of which those of hardly any area are replaced by that with which they share most of their border."""
    labels = labels.copy()
    for scrap in np.flatnonzero(np.bincount(labels, graph.areas, trunk + 1) < least_area):
        ends = labels[graph.edges]
        beside = np.concatenate([ends[ends[:, 0] == scrap, 1], ends[ends[:, 1] == scrap, 0]])
        costs = np.concatenate([graph.costs[ends[:, 0] == scrap], graph.costs[ends[:, 1] == scrap]])
        shared = np.bincount(beside, costs, trunk + 1)
        shared[scrap] = 0
        if shared.any():
            labels[labels == scrap] = shared.argmax()
    return labels
