"""Pictures of segmented surfaces, drawn off screen."""

import numpy as np
import pyvista

from heatwalk import faces_from_vertices
from heatwalk.files import label_colours
from studies.metrics import match_labels

TILE = (480, 400)  # pixels
TILT = 20  # degrees that the camera looks down from the side

# The last reference made in this process: the pictures of one model are asked for one after the other.
_last_reference = {}


def picture(task):
    """The picture of a trial's original or variant, both seen from the same side: (height, width, 3) uint8 array.

    task : (trial, whether to draw the original)
    """
    trial, original = task
    reference = _reference(trial)
    view = _view(np.asarray(reference.mesh.vertices))
    if original:
        return _draw(reference.mesh, reference.labels, view)
    variant = trial.variant(reference)
    return _draw(variant.mesh, _named_as_in_reference(variant), view)


def _reference(trial):
    if trial.shares not in _last_reference:
        _last_reference.clear()
        _last_reference[trial.shares] = trial.prepare()
    return _last_reference[trial.shares]


def _named_as_in_reference(variant):
    """The variant's labels, renamed so that a part has the number, and so the colour, that it has in the reference.

    The background (-1) stays the background in both: it is not a part to be matched.
    """
    before, after = variant.compared()
    both = (before >= 0) & (after >= 0)
    named = np.full(len(variant.labels), -1)
    parts = np.unique(variant.labels[variant.labels >= 0])
    fresh = variant.reference.labels.max() + 1 + len(parts)
    names = dict(zip(parts.tolist(), range(fresh, fresh + len(parts)), strict=True))
    if both.any():
        names |= dict(zip(after[both].tolist(), match_labels(before[both], after[both]).tolist(), strict=True))
    for part, name in names.items():
        named[variant.labels == part] = name
    return named


def _draw(mesh, labels, view):
    """The mesh with its faces coloured by segment: (height, width, 3) uint8 array.

    labels : (n,) int array, a label a vertex, -1 for the background
    view : (3, 3) array, rows right, up and towards the camera
    """
    of_faces = faces_from_vertices(labels, mesh.faces)
    background = labels.max() + 1
    # Turned to the camera, which then looks along z.
    points = (np.asarray(mesh.vertices) - mesh.bounds[0]) / mesh.extents.max() @ view.T
    surface = pyvista.PolyData.from_regular_faces(points, mesh.faces)
    surface.cell_data["colour"] = label_colours(np.where(of_faces < 0, background, of_faces), background)[:, :3]
    with pyvista.vtk_verbosity("off"):  # VTK warns where there is no screen, and draws all the same
        plotter = pyvista.Plotter(off_screen=True, window_size=TILE)
        plotter.add_mesh(surface, scalars="colour", rgb=True, ambient=0.25, diffuse=0.8)
        plotter.view_xy()
        plotter.enable_parallel_projection()
        width, height, _ = np.ptp(points, axis=0)
        plotter.camera.parallel_scale = 0.52 * max(height, width * TILE[1] / TILE[0])
        image = plotter.screenshot(return_img=True)
        plotter.close()
    return image


def _view(vertices):
    """Where to look at a shape from: rows right, up and towards the camera of a (3, 3) array.

    Across the direction in which it is thinnest, so that it spreads before the camera; upright by the coordinate axis
    (y, as most models have it, else z) that is then nearer to the vertical.
    """
    centred = vertices - vertices.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    towards = axes[:, 0] * np.sign(axes[np.abs(axes[:, 0]).argmax(), 0])
    up = np.eye(3)[1] if abs(towards[1]) < 0.7 else np.eye(3)[2]
    up = up - towards * (towards @ up)
    up /= np.linalg.norm(up)
    tilt = np.deg2rad(TILT)
    towards, up = np.cos(tilt) * towards + np.sin(tilt) * up, np.cos(tilt) * up - np.sin(tilt) * towards
    return np.array([np.cross(up, towards), up, towards])
