"""The paper's Figures 1 to 7 and 15: a mesh and its segmentation in, a figure and the numbers of its caption out.

Each function gives (matplotlib Figure, dict of numbers); ``figures.save`` writes the figure. Here a mesh is a
trimesh.Trimesh, and ``seg`` what ``heatwalk.segment`` gives for it.
"""

import matplotlib
import numpy as np
import pymeshlab
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from heatwalk.io import label_colours
from studies.figures.curves import STYLE, grid
from studies.figures.surfaces import FIELD_COLOURS, named_as, surface, view_of
from studies.metrics import change_percentage

HELD = 0.9  # the share of the heat within the diffusion radius (paper, section 3)
BAR = 0.32  # inches under a picture for its colour bar
PALE = 0.6  # how far the colours of groups that still walk are from the segments' colours to white
CLEAR = 0.7  # least cosine between the line of sight and the normal of a vertex that is marked


def pipeline(mesh, seg):
    """Figure 1: the input, heat from a point, accumulator regions, and these with the dissipator region.

    The point is the exemplar nearest to the viewer, which nothing hides.

    Numbers
    -------
    vertices, exemplar (the point), accumulator_regions, dissipator_share (of the vertices)
    """
    view = view_of(np.asarray(mesh.vertices))
    point = int(seg.exemplars[(np.asarray(mesh.vertices)[seg.exemplars] @ view.axes[2]).argmax()])
    heat = _heat(seg.kernel, point)
    figure, axes = grid(
        [
            [
                (surface(mesh, view), "(a) input"),
                (surface(mesh, view, field=heat, points=[point]), "(b) heat from a point"),
                (surface(mesh, view, labels=seg.accumulator_labels), "(c) accumulator regions"),
                (surface(mesh, view, labels=segments(seg)), "(d) with dissipators"),
            ]
        ],
        below=BAR,
    )
    _colour_bar(axes[0][1], heat.min(), heat.max(), "heat")
    return figure, {
        "vertices": len(mesh.vertices),
        "exemplar": point,
        "accumulator_regions": len(seg.exemplars),
        "dissipator_share": float(seg.dissipates.mean()),
    }


def diffusion(mesh, seg):
    """Figure 2: heat from a dissipator and from an accumulator at the same time, in the same colours.

    The line is the diffusion radius. Of the vertices that face the viewer, the dissipator is the one whose heat is the
    least divergent from the uniform, the accumulator the one whose heat is the most.

    Numbers
    -------
    For each, after its name: its vertex; its ``_radius``, in square roots of the mesh's area; and ``_area``, the share
    of the area within this radius.
    """
    view = view_of(np.asarray(mesh.vertices))
    facing = np.flatnonzero(mesh.vertex_normals @ view.axes[2] > CLEAR)
    divergence = seg.divergence_from_uniform[facing]
    points = {"dissipator": int(facing[divergence.argmin()]), "accumulator": int(facing[divergence.argmax()])}
    heats = {name: _heat(seg.kernel, point) for name, point in points.items()}
    clim = (0.0, max(heat.max() for heat in heats.values()))
    pictures, numbers = [], {}
    for name, point in points.items():
        radius, distance = diffusion_radius(mesh, seg.kernel, point)
        numbers |= {
            name: point,
            f"{name}_radius": radius,
            f"{name}_area": float(seg.kernel.mass[distance <= radius].sum() / seg.kernel.mass.sum()),
        }
        # Beyond any distance on the mesh, where a vertex is on another component.
        reached = np.where(np.isfinite(distance), distance, 2 * distance[np.isfinite(distance)].max() + 1)
        drawn = surface(mesh, view, field=heats[name], clim=clim, points=[point], contour=(reached, radius))
        pictures.append((drawn, f"{name}: radius {radius:.2f}, {100 * numbers[f'{name}_area']:.0f} % of the area"))
    figure, axes = grid([pictures], below=BAR)
    for axis in axes[0]:
        _colour_bar(axis, *clim, "heat")
    return figure, numbers


def diffusion_radius(mesh, kernel, point):
    """The geodesic distance from a point within which 90 % of its heat is (paper, section 3).

    Parameters
    ----------
    mesh : trimesh.Trimesh of n vertices
    kernel : heatwalk.kernel.HeatKernel
    point : int, a vertex

    Returns
    -------
    radius : float, in square roots of the mesh's area
    distance : (n,) float array, geodesic distance from the point in the same unit, infinite on another component

    Notes
    -----
    Heat is an integral over the surface here: the sum of mass times h(point, ·), which is 1 over all of it.
    """
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(np.asarray(mesh.vertices) / np.sqrt(mesh.area), np.asarray(mesh.faces)))
    meshes.compute_scalar_by_geodesic_distance_from_given_point_per_vertex(
        startpoint=meshes.current_mesh().vertex_matrix()[point],
        maxdistance=pymeshlab.PureValue(1e6),  # farther than any two points of a surface of area 1 in practice
    )
    distance = meshes.current_mesh().vertex_scalar_array().copy()
    distance[kernel.component != kernel.component[point]] = np.inf
    order = np.argsort(distance, kind="stable")
    held = np.cumsum((kernel.mass * _heat(kernel, point))[order])
    return float(distance[order[np.searchsorted(held, HELD * held[-1])]]), distance


def walk(mesh, seg):
    """Figure 3: the groups after each step of the walk.

    A group whose exemplar is a root of the walk has its segment's colour, the others pale ones.

    Numbers
    -------
    settled : the share of vertices in their final group after 0, 1, 2 … steps, as ``settled_shares`` gives it
    exemplars : how many exemplars are left then
    """
    view = view_of(np.asarray(mesh.vertices))
    shares = settled_shares(seg.walk)
    pictures, left = [], []
    for step, (stands, share) in enumerate(zip(seg.walk.steps, shares, strict=True)):
        left.append(len(np.unique(stands)))
        caption = f"step {step}: {left[-1]:,} groups\n{100 * share:.1f} % settled"
        pictures.append((surface(mesh, view, colours=_of_groups(seg.walk, stands)), caption))
    # Six steps to a row at most.
    lines = [pictures[i : i + 6] for i in range(0, len(pictures), 6)]
    figure, _ = grid(lines)
    return figure, {"settled": shares.tolist(), "exemplars": left}


def settled_shares(walk):
    """The share of vertices that are in their final group after 0, 1, 2 … steps: (steps + 1,) float array.

    A vertex is when it stands at the exemplar that it never leaves. The last share is 1.

    Parameters
    ----------
    walk : heatwalk.accumulators.HeatWalk
    """
    return np.array([np.mean(stands == walk.steps[-1]) for stands in walk.steps])


def divergences(mesh, seg):
    """Figure 4: the heat kernel signature, and the divergences from the uniform and from the region's heat.

    Each has its own colours, from its smallest value to its largest.

    Numbers
    -------
    For signature, from_uniform and from_region: the (smallest, largest) value, the divergences in nats
    """
    view = view_of(np.asarray(mesh.vertices))
    fields = {
        "signature": (seg.kernel.diagonal(), "(a) heat kernel signature", "h(x, x)"),
        "from_uniform": (seg.divergence_from_uniform, "(b) divergence from uniform", "nats"),
        "from_region": (seg.divergence_from_region, "(c) divergence from region", "nats"),
    }
    figure, axes = grid(
        [[(surface(mesh, view, field=field), caption) for field, caption, _ in fields.values()]], below=BAR
    )
    for axis, (field, _, unit) in zip(axes[0], fields.values(), strict=True):
        _colour_bar(axis, field.min(), field.max(), unit)
    return figure, {name: (float(field.min()), float(field.max())) for name, (field, _, _) in fields.items()}


def showcase(items, columns=5, upright=1):
    """Figures 5, 6 and 7: segmented models or poses, each framed on its own.

    Colours mean the same part in two pictures only where the labels do (see ``render.named_as``).

    Parameters
    ----------
    items : list of (mesh, (n,) int labels with -1 for the background, caption); the number of segments is put behind
    columns : int, pictures in a row
    upright : 1 or 2, the vertical axis, as ``render.view_of`` takes it

    Numbers
    -------
    segments : dict, caption -> the number of segments, the background included
    """
    pictures, counts = [], {}
    for mesh, labels, caption in items:
        counts[caption] = len(np.unique(labels))
        drawn = surface(mesh, view_of(np.asarray(mesh.vertices), upright), labels=labels)
        pictures.append((drawn, f"{caption} ({counts[caption]})"))
    figure, _ = grid([pictures[i : i + columns] for i in range(0, len(pictures), columns)])
    return figure, {"segments": counts}


def over_time(mesh, segs, reference):
    """Figure 15: one model segmented at several times.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    segs : list of Segmentation, of this mesh, by time
    reference : Segmentation at the time after which the parts are named, the paper's 1

    Numbers
    -------
    segments : dict, time -> the number of segments
    change : dict, time -> Change Percentage from the reference
    """
    view = view_of(np.asarray(mesh.vertices))
    named = segments(reference)
    pictures, counts, change = [], {}, {}
    for seg in segs:
        labels = segments(seg)
        time = round(seg.time, 10)  # what was asked for, without the rounding of its unit's factor
        counts[time], change[time] = len(np.unique(labels)), change_percentage(named, labels)
        drawn = surface(mesh, view, labels=named_as(named, labels, labels))
        pictures.append((drawn, f"t = {time:g}: {counts[time]} segments"))
    figure, _ = grid([pictures])
    return figure, {"segments": counts, "change": change}


def segments(seg):
    """A segmentation's labels with the dissipator region as the background: (n,) int array, -1 where it is."""
    return np.where(seg.dissipates, -1, seg.labels)


def _heat(kernel, point):
    """h(point, ·), (n,), 0 on the components that its heat does not reach."""
    return np.where(kernel.component == kernel.component[point], kernel.factor @ kernel.factor[point], 0.0)


def _of_groups(walk, stands):
    """A colour a vertex by where it stands: (n, 3) uint8 array."""
    settled = stands == walk.steps[-1]
    # Neighbouring vertices have neighbouring numbers: spread over the colours, so that neighbours differ.
    scattered = label_colours(stands * 7919 % 20)[:, :3]
    pale = np.rint(scattered + PALE * (255.0 - scattered)).astype(np.uint8)
    return np.where(settled[:, None], label_colours(walk.labels)[:, :3], pale)


@matplotlib.rc_context(STYLE)
def _colour_bar(axes, low, high, unit):
    """A colour bar below a picture that ``figures.grid`` left room under."""
    height = axes.get_position().height * axes.figure.get_figheight()
    place = axes.inset_axes((0.15, -0.12 / height, 0.7, 0.07 / height))
    bar = axes.figure.colorbar(ScalarMappable(Normalize(low, high), FIELD_COLOURS), cax=place, orientation="horizontal")
    bar.set_ticks([low, (low + high) / 2, high])
    bar.ax.set_xticklabels([f"{low if low > high / 1000 else 0:.2g}", unit, f"{high:.2g}"])
    bar.ax.tick_params(length=2, pad=1, labelsize=7)
    bar.outline.set_linewidth(0.4)
