"""Where a shape is seen from, and what a picture of it has to contain."""

from dataclasses import dataclass

import numpy as np

TILT = 20  # degrees by which the camera looks down on the shape
HEAD_ON = 0.7  # cosine above which the upright axis points at the camera rather than up


@dataclass(frozen=True)
class View:
    """A direction of view and a frame.

    Parameters
    ----------
    axes : (3, 3) float array
        rows are the directions right, up and towards the camera
    centre : (3,) float array
        point in the middle of the picture
    extent : (2,) float array
        width and height of what has to be visible, in the unit of the shape
    """

    axes: np.ndarray
    centre: np.ndarray
    extent: np.ndarray


def view_of(vertices: np.ndarray, upright: int = 1, turn: float = 0.0) -> View:
    """The view of a shape along the direction in which it is thinnest, so that it spreads before the camera.

    Parameters
    ----------
    vertices : (n, 3) float array
        the shape
    upright : {1, 2}
        axis that points up in the picture: y, as in most models, or z, as in those of TOSCA; if it points at the
        camera, the other one is used
    turn : float
        degrees by which the camera is moved around the vertical axis, to the right; 180 shows the other side

    Returns
    -------
    View
        framed on the shape

    Examples
    --------
    >>> flat = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0], [4.0, 3.0, 0.1]])
    >>> view_of(flat).extent.round(1).tolist()
    [4.0, 2.8]
    """
    centred = vertices - vertices.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    towards = axes[:, 0] * np.sign(axes[np.abs(axes[:, 0]).argmax(), 0])
    up = np.eye(3)[upright if abs(towards[upright]) < HEAD_ON else 3 - upright]
    up = up - towards * (towards @ up)
    up /= np.linalg.norm(up)
    angle = np.deg2rad(turn)
    towards = np.cos(angle) * towards + np.sin(angle) * np.cross(up, towards)
    tilt = np.deg2rad(TILT)
    towards, up = np.cos(tilt) * towards + np.sin(tilt) * up, np.cos(tilt) * up - np.sin(tilt) * towards
    return view_along(vertices, np.array([np.cross(up, towards), up, towards]))


def view_along(vertices: np.ndarray, axes: np.ndarray) -> View:
    """The view along given axes in which some vertices fill the picture.

    Parameters
    ----------
    vertices : (n, 3) float array
        what has to be visible
    axes : (3, 3) float array
        rows are the directions right, up and towards the camera

    Returns
    -------
    View

    Examples
    --------
    >>> view_along(np.array([[0.0, 0.0, 0.0], [4.0, 2.0, 1.0]]), np.eye(3)).extent.tolist()
    [4.0, 2.0]
    """
    turned = vertices @ axes.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    return View(axes, (low + high) / 2 @ axes, (high - low)[:2])
