"""What a viewer shows, as plain data: surfaces side by side with their segments, what changed, and functions on them.

`studies.reporting.html` packs scenes into a page; nothing here knows how they are drawn. Meshes are reduced for display
by choosing some of their vertices, so that everything that belongs to a vertex (its segment, whether it changed, the
value of a function) is carried over as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import numpy as np
from scipy.spatial import KDTree

MOST_FACES = 8000  # of a surface in a viewer


@dataclass(frozen=True, eq=False)
class Field:
    """A function on a surface.

    Parameters
    ----------
    values : (n,) float array
        value at each vertex; NaN where there is none
    low, high : float
        values at the ends of the colours
    unit : str
        what the values are, shown below the colours
    diverging : bool
        whether the colours are those for values on both sides of the middle, as for signs
    """

    values: np.ndarray
    low: float = 0.0
    high: float = 1.0
    unit: str = ""
    diverging: bool = False


@dataclass(frozen=True, eq=False)
class Heat:
    """Heat from a vertex, which the viewer computes from eigenpairs for whatever vertex is picked.

    Parameters
    ----------
    eigenvalues : (c, k) float array
        of each connected component, inf where there is none
    eigenvectors : (n, k) float array
        at each vertex of the surface
    component : (n,) int array
        connected component of each vertex
    time : float
        standard time for which heat has flowed
    point : int
        vertex that is picked first
    """

    eigenvalues: np.ndarray
    eigenvectors: np.ndarray
    component: np.ndarray
    time: float
    point: int

    def values(self, point: int | None = None) -> np.ndarray:
        """The heat at every vertex, (n,) float array, from a vertex, by default that which is picked first.

        Examples
        --------
        >>> heat = Heat(np.array([[0.0, 2.0]]), np.array([[1.0, 1.0], [1.0, -1.0]]), np.zeros(2, int), 0.5, 0)
        >>> heat.values().round(3)
        array([1.368, 0.632])
        """
        at = self.point if point is None else point
        of_component = self.component == self.component[at]
        weights = np.exp(-self.eigenvalues[self.component[at]] * self.time) * self.eigenvectors[at]
        return np.where(of_component, self.eigenvectors @ weights, 0.0)


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangle mesh as it is displayed: equal objects are stored once, however many viewports show them.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    """

    vertices: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True, eq=False)
class Viewport:
    """A surface and what is shown on it.

    Parameters
    ----------
    surface : Surface
        n vertices
    title : str
        above it, such as "original"
    row : str
        what it has in common with the viewports beside it, such as the method; rows can be hidden
    note : str
        below the title, such as the Change Percentage
    labels : (n,) int array, optional
        segment of each vertex, -1 for the background; a number is a colour
    changed : (n,) bool array, optional
        vertices that are highlighted
    fields : mapping of str to Field
        functions that can be shown instead of the segments, by name
    shows : str
        the function that is shown whatever is chosen
    heat : Heat, optional
        shown instead of the segments; a click moves its source
    faded : (n,) bool array, optional
        vertices whose colours are pale
    axes : (3, 3) float array, optional
        from which this surface is seen first, if not as the scene; dragging turns it as much as the others
    """

    surface: Surface
    title: str = ""
    row: str = ""
    note: str = ""
    labels: np.ndarray | None = None
    changed: np.ndarray | None = None
    fields: Mapping[str, Field] = field(default_factory=dict)
    shows: str = ""
    heat: Heat | None = None
    faded: np.ndarray | None = None
    axes: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """What a viewer shows at once.

    Parameters
    ----------
    at : mapping
        the values that are picked to see it, such as ``{"model": "ant", "level": 0.1, "repeat": 0}``; the same names in
        every scene of a viewer
    viewports : sequence of Viewport
        side by side, a line for each row
    text : str
        what it shows, in one line
    value : float, optional
        the scenes with the largest values are listed first
    axes : (3, 3) float array, optional
        rows are the directions right, up and towards the camera, from which it is seen first
    key : str
        identifies it, such as the ids of trials
    slider : str
        what the value of the slider is, if that differs from scene to scene
    """

    at: Mapping[str, str | int | float]
    viewports: Sequence[Viewport]
    text: str = ""
    value: float | None = None
    axes: np.ndarray | None = None
    key: str = ""
    slider: str = ""


class ScenesToMake(Protocol):
    """The scenes of a viewer before they are made: what worker processes compute, task by task.

    Attributes
    ----------
    slider : str
        the name, among those that are picked, that has a slider
    content : str
        what they are made from, by which a page tells whether it has to make them again
    function : callable
        a task -> its scenes
    """

    slider: ClassVar[str]

    @property
    def content(self) -> str:
        """What they are made from."""

    @property
    def function(self) -> Callable[[Any], list[Scene]]:
        """Makes the scenes of a task."""

    def tasks(self) -> Sequence[Any]:
        """What worker processes are given."""


@dataclass(frozen=True, eq=False)
class Reduced:
    """Some of the vertices of a mesh, and triangles between them.

    Parameters
    ----------
    source : (k,) int array
        vertices of the mesh
    faces : (m, 3) int array
        numbers in ``source``
    """

    source: np.ndarray
    faces: np.ndarray

    def surface(self, vertices: np.ndarray) -> Surface:
        """The reduced mesh, or one with the same faces and other coordinates."""
        return Surface(vertices[self.source], self.faces)


def reduce_mesh(vertices: np.ndarray, faces: np.ndarray, most_faces: int = MOST_FACES) -> Reduced:
    """Choose vertices of a mesh that show its shape with at most a certain number of faces.

    The mesh is simplified by quadrics, and each vertex of the result is replaced by the nearest one of the mesh.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    most_faces : int

    Returns
    -------
    Reduced
        with vertices that faces use only, and all faces if these are few enough

    Examples
    --------
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere(4)
    >>> reduced = reduce_mesh(sphere.vertices, sphere.faces, 500)
    >>> len(sphere.faces), len(reduced.faces) <= 500
    (5120, True)
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    chosen = faces
    if len(faces) > most_faces:
        from fast_simplification import simplify

        # In the unit box, since the simplification computes with single precision.
        low = vertices.min(axis=0)
        scaled = (vertices - low) / (np.ptp(vertices, axis=0).max() or 1.0)
        points, triangles = simplify(
            np.ascontiguousarray(scaled, np.float32),
            np.ascontiguousarray(faces, np.int32),
            target_count=most_faces,
        )
        nearest = np.asarray(KDTree(scaled).query(points)[1])
        chosen = nearest[triangles]
        a, b, c = chosen.T
        chosen = chosen[(a != b) & (b != c) & (c != a)]
    source, numbers = np.unique(chosen, return_inverse=True)
    return Reduced(source, numbers.reshape(-1, 3))
