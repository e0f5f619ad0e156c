"""Pictures of surfaces, drawn off screen: segments, functions on the surface, marked points."""

from dataclasses import dataclass

import numpy as np

from heatwalk import faces_from_vertices
from heatwalk.io import label_colours
from studies.metrics import match_labels

TILE = (720, 600)  # pixels, width and height: 2.4 in at 300 dpi
MARGIN = 0.04  # of the tile, left white on each side
TILT = 20  # degrees that the camera looks down from the side
FIELD_COLOURS = "viridis"  # perceptually uniform, and read in grey and by the colour-blind
MARK = "#d00000"
TRANSPARENT = 0.35  # opacity of a surface through which its tubes are seen

STYLES = ("variant", "on_original", "transparent", "edges", "scaled")


@dataclass(frozen=True)
class View:
    """Where a shape is looked at from, and what the picture holds.

    Attributes
    ----------
    axes : (3, 3) array, rows right, up and towards the camera
    centre : (3,) array, in the middle of the picture
    extent : (2,) array, width and height of what has to be seen, in the shape's own unit
    """

    axes: np.ndarray
    centre: np.ndarray
    extent: np.ndarray


def view_of(vertices, upright=1):
    """The view of a shape, framed on it: View.

    Across the direction in which it is thinnest, so that it spreads before the camera; upright along the given
    axis, or where that points at the camera along the other of y and z.

    Parameters
    ----------
    vertices : (n, 3) float array
    upright : 1 or 2, the axis y, as most models have it, or z, as those of TOSCA have it
    """
    centred = vertices - vertices.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    towards = axes[:, 0] * np.sign(axes[np.abs(axes[:, 0]).argmax(), 0])
    up = np.eye(3)[upright if abs(towards[upright]) < 0.7 else 3 - upright]
    up = up - towards * (towards @ up)
    up /= np.linalg.norm(up)
    tilt = np.deg2rad(TILT)
    towards, up = np.cos(tilt) * towards + np.sin(tilt) * up, np.cos(tilt) * up - np.sin(tilt) * towards
    return framed(vertices, np.array([np.cross(up, towards), up, towards]))


def framed(vertices, axes):
    """The view along given axes, (3, 3), with the vertices filling the picture: View."""
    turned = vertices @ axes.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    return View(axes, (low + high) / 2 @ axes, (high - low)[:2])


def surface(
    mesh,
    view,
    *,
    labels=None,
    colours=None,
    field=None,
    clim=None,
    points=None,
    contour=None,
    solid=None,
    opacity=1.0,
    edges=False,
    size=TILE,
):
    """Draw a surface on white: (height, width, 3) uint8 array. The same arguments give the same bytes.

    Parameters
    ----------
    mesh : trimesh.Trimesh of n vertices and m faces
    view : View
    labels : (n,) int array, optional
        a segment a vertex, each in the colour of ``heatwalk.io.label_colours``, the background (-1) in its grey.
        Without labels, colours and field the whole surface is grey.
    colours : (n, 3) uint8 array, optional
        a colour a vertex instead; a face has that of its first corner
    field : (n,) float array, optional
        a function to show in ``FIELD_COLOURS`` instead
    clim : (low, high), optional
        what the ends of the colours stand for; the smallest and largest value without
    points : (p,) int array, optional
        vertices marked by a ball
    contour : ((n,) float array, level), optional
        a line drawn where this function has this level
    solid : (m,) bool array, optional
        faces drawn black, and opaque whatever the opacity
    opacity : float, of the surface, 0 to 1
    edges : bool, whether to draw the triangles' edges
    size : (width, height) in pixels

    Raises
    ------
    ValueError
        when more than one of labels, colours and field is given
    """
    import pyvista  # not before something is drawn: figures of curves take a colour from here, and no VTK

    if sum(shown is not None for shown in (labels, colours, field)) > 1:
        raise ValueError("a surface shows labels, colours or a field: leave out the others")
    # In units of the picture, turned to the camera, which then looks along z: coordinates of any size draw alike.
    width, height = size
    unit = max(view.extent[0] / width, view.extent[1] / height) / (1 - 2 * MARGIN)
    vertices = (np.asarray(mesh.vertices) - view.centre) @ view.axes.T / unit
    shape = pyvista.PolyData.from_regular_faces(vertices, mesh.faces)
    if field is not None:
        shape.point_data["field"] = field
        painted = {"scalars": "field", "cmap": FIELD_COLOURS, "clim": clim, "interpolate_before_map": True}
    else:
        shape.cell_data["colour"] = _of_segments(labels, mesh.faces) if colours is None else colours[mesh.faces[:, 0]]
        painted = {"scalars": "colour", "rgb": True}
    if contour is not None:
        shape.point_data["contour"] = contour[0]
    if solid is not None:
        shape.cell_data["solid"] = solid

    with pyvista.vtk_verbosity("off"):  # VTK warns where there is no screen, and draws all the same
        plotter = pyvista.Plotter(off_screen=True, window_size=size, lighting="none")
        plotter.background_color = "white"
        # From beside the camera, so that the surface's relief is seen, and weakly from the other side.
        for position, intensity in (((-0.4, 0.6, 1.0), 0.85), ((0.8, -0.2, 0.6), 0.3)):
            plotter.add_light(pyvista.Light(position=position, intensity=intensity, light_type="camera light"))
        # No highlights: what is lit keeps the hue of its segment. Less shade on a function, whose colours are read off.
        material = {
            "ambient": 0.3 if field is None else 0.5,
            "diffuse": 0.75 if field is None else 0.5,
            "specular": 0.0,
        }
        rest = shape
        if solid is not None:
            rest = shape.extract_cells(np.flatnonzero(~solid)).extract_surface(algorithm=None)
            tubes = shape.extract_cells(np.flatnonzero(solid)).extract_surface(algorithm=None)
            plotter.add_mesh(tubes, color="black", lighting=False)
        plotter.add_mesh(
            _creased(rest), opacity=opacity, show_edges=edges, edge_opacity=0.5, line_width=1.0,
            show_scalar_bar=False, **painted, **material,
        )  # fmt: skip
        if contour is not None:
            line = shape.contour([contour[1]], scalars="contour")
            if line.n_points:
                plotter.add_mesh(line.tube(radius=0.004 * width), color="black", lighting=False)
        if points is not None:
            balls = pyvista.PolyData(vertices[points]).glyph(
                geom=pyvista.Sphere(radius=0.014 * width), scale=False, orient=False
            )
            plotter.add_mesh(balls, color=MARK, **material)
        if opacity < 1:
            plotter.enable_depth_peeling(number_of_peels=12)
        plotter.enable_anti_aliasing("ssaa")
        _look_along_z(plotter, vertices, height)
        image = plotter.screenshot(return_img=True)
        plotter.close()
    return image


def _of_segments(labels, faces):
    """(m, 3) uint8 array, a colour a face; all grey without labels."""
    if labels is None:
        labels = np.full(faces.max() + 1, -1)
    of_faces = faces_from_vertices(labels, faces)
    background = max(of_faces.max(), 0) + 1
    return label_colours(np.where(of_faces < 0, background, of_faces), background)[:, :3]


def _creased(shape):
    """With normals that vary smoothly but for sharp creases, where a machine part has its edges."""
    return shape.compute_normals(
        cell_normals=False,
        split_vertices=True,
        feature_angle=45,
        consistent_normals=False,
        auto_orient_normals=False,
    )


def _look_along_z(plotter, vertices, height):
    """Show height pixels, one to a unit, around the origin, with everything between the clipping planes."""
    far = 2 * np.abs(vertices).max() + height
    camera = plotter.camera
    camera.focal_point, camera.position, camera.up = (0, 0, 0), (0, 0, far), (0, 1, 0)
    camera.enable_parallel_projection()
    camera.parallel_scale = height / 2
    camera.clipping_range = (0.01 * far, 2 * far)


def pictures(task):
    """Pictures of an original and of its variants from the same side: list of (height, width, 3) uint8 arrays.

    Parameters
    ----------
    task : (list of trials of one model, style), where style says how the variants are drawn
        "variant": segmented, all in one frame
        "on_original": so, and above it the original, in a frame of its own, with the variant's segments (Figure 10)
        "transparent": the faces that the original does not have, black, seen through the rest (Figure 11)
        "edges": with the edges of the triangles (Figure 13)
        "scaled": in a frame of its own, for a gallery that draws it in proportion (Figure 14)
    """
    trials, style = task
    reference = trials[0].prepare()
    variants = [trial.variant(reference) for trial in trials]
    own = wide = view_of(np.asarray(reference.mesh.vertices))
    if style != "scaled":
        # What sticks out of the original is to be seen too.
        wide = framed(np.concatenate([reference.mesh.vertices, *(v.mesh.vertices for v in variants)]), own.axes)
    original = surface(
        reference.mesh, own if style == "on_original" else wide, labels=reference.labels, edges=style == "edges"
    )
    if style == "on_original":
        original = np.concatenate([original, np.full_like(original, 255)])
    return [original, *(_variant(variant, own, wide, style) for variant in variants)]


def _variant(variant, own, wide, style):
    before, after = variant.compared()
    labels = named_as(before, after, variant.labels)
    original = variant.reference.mesh
    if style == "transparent":
        added = added_faces(original.faces, variant.mesh.faces, variant.counterpart)
        return surface(variant.mesh, wide, labels=labels, solid=added, opacity=TRANSPARENT)
    if style == "scaled":
        wide = framed(np.asarray(variant.mesh.vertices), own.axes)
    drawn = surface(variant.mesh, wide, labels=labels, edges=style == "edges")
    if style == "on_original":
        # Where a vertex is gone it has no label, and is grey.
        carried = np.where(variant.counterpart < 0, -1, labels[variant.counterpart])
        return np.concatenate([surface(original, own, labels=carried), drawn])
    return drawn


def named_as(before, after, labels):
    """Labels renamed so that a part has the number, and so the colour, that it has in a reference: (n,) int array.

    The background (-1) stays the background in both: it is not a part to be matched. Parts without a partner are
    numbered on from the largest label of the reference.

    Parameters
    ----------
    before, after : (p,) int arrays, the reference's and the renamed segmentation's labels of the same p points
    labels : (n,) int array, of all points of the renamed segmentation
    """
    both = (before >= 0) & (after >= 0)
    named = np.full(len(labels), -1)
    parts = np.unique(labels[labels >= 0])
    fresh = max(before.max(initial=-1), -1) + 1 + len(parts)
    names = dict(zip(parts.tolist(), range(fresh, fresh + len(parts)), strict=True))
    if both.any():
        names |= dict(zip(after[both].tolist(), match_labels(before[both], after[both]).tolist(), strict=True))
    for part, name in names.items():
        named[labels == part] = name
    return named


def added_faces(original, faces, counterpart):
    """The faces of a variant that its original does not have: (m,) bool array, for short circuits those of the tubes.

    Parameters
    ----------
    original : (m₀, 3) int array, the faces of the original
    faces : (m, 3) int array, the faces of the variant
    counterpart : (n₀,) int array, the variant's vertex for each of the original, -1 where it is gone
    """
    moved = counterpart[original]
    moved = np.sort(moved[(moved >= 0).all(axis=1)], axis=1)
    _, which = np.unique(np.concatenate([moved, np.sort(faces, axis=1)]), axis=0, return_inverse=True)
    return np.isin(which[len(moved) :], which[: len(moved)], invert=True)
