"""Pictures of surfaces, rendered off screen: segments, functions on the surface, marked points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from studies.figures.colours import face_colours
from studies.figures.style import FIELD_COLOURS
from studies.figures.views import View

if TYPE_CHECKING:
    import pyvista
    import trimesh

TILE = (720, 600)  # width and height in pixels: 2.4 inches at 300 dots per inch
MARGIN = 0.04  # share of the picture that is left white on each side
MARK_COLOUR = "#d00000"
GHOST_COLOUR, GHOST_OPACITY = "#8890a0", 0.16
CREASE = 45  # degrees between faces from which an edge is drawn sharp

# Direction and intensity of the lights: from one side of the camera, which makes relief visible, and weakly from the
# other.
LIGHTS = (((-0.4, 0.6, 1.0), 0.85), ((0.8, -0.2, 0.6), 0.3))

# No highlights, so that what is lit keeps its hue. A function is shaded less, since its values are read from colours.
SEGMENT_MATERIAL: dict[str, Any] = {"ambient": 0.3, "diffuse": 0.75, "specular": 0.0}
FIELD_MATERIAL: dict[str, Any] = {"ambient": 0.5, "diffuse": 0.5, "specular": 0.0}


def surface(
    mesh: trimesh.Trimesh,
    view: View,
    *,
    labels: np.ndarray | None = None,
    colours: np.ndarray | None = None,
    field: np.ndarray | None = None,
    field_range: tuple[float, float] | None = None,
    points: np.ndarray | list[int] | None = None,
    contour: tuple[np.ndarray, float] | None = None,
    solid: np.ndarray | None = None,
    opacity: float = 1.0,
    ghost: trimesh.Trimesh | None = None,
    edges: bool = False,
    size: tuple[int, int] = TILE,
) -> np.ndarray:
    """Render a surface on white. The same arguments give the same bytes.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        n vertices and m faces
    view : View
    labels : (n,) int array, optional
        segment of each vertex, shown in the colours of ``heatwalk.io.label_colours``; the background (-1) is grey.
        Without labels, colours and field the whole surface is grey.
    colours : (n, 3) uint8 array, optional
        colour of each vertex, instead of labels; a face has the colour of its first corner
    field : (n,) float array, optional
        function to show in ``FIELD_COLOURS``, instead of labels
    field_range : (low, high), optional
        values of the field at the ends of the colours; by default its smallest and largest value
    points : (p,) int array, optional
        vertices marked by a ball
    contour : ((n,) float array, level), optional
        function on the surface, and the level of it at which a line is drawn
    solid : (m,) bool array, optional
        faces drawn black, and opaque whatever the opacity
    opacity : float
        opacity of the surface, 0 to 1
    ghost : trimesh.Trimesh, optional
        another surface, drawn faintly: what is not there any more
    edges : bool
        whether to draw the edges of the triangles
    size : (width, height)
        in pixels

    Returns
    -------
    (height, width, 3) uint8 array

    Raises
    ------
    ValueError
        if more than one of labels, colours and field is given

    Examples
    --------
    >>> import trimesh
    >>> from studies.figures.views import view_of
    >>> box = trimesh.creation.box()
    >>> surface(box, view_of(box.vertices), size=(120, 100)).shape
    (100, 120, 3)
    """
    import pyvista  # loads VTK, which only rendering needs

    if sum(shown is not None for shown in (labels, colours, field)) > 1:
        raise ValueError("labels, colours and field exclude each other: give one of them")
    vertices = _picture_coordinates(np.asarray(mesh.vertices), view, size)
    shape = pyvista.PolyData.from_regular_faces(vertices, mesh.faces)
    paint = _paint(shape, np.asarray(mesh.faces), labels, colours, field, field_range)
    material = SEGMENT_MATERIAL if field is None else FIELD_MATERIAL
    with pyvista.vtk_verbosity("off"):  # without a screen, VTK warns and then renders correctly
        plotter = _lit_plotter(size)
        try:
            if solid is not None and solid.any():  # VTK refuses a surface without faces
                plotter.add_mesh(_part(shape, solid), color="black", lighting=False)
            if solid is None or not solid.all():
                rest = shape if solid is None else _part(shape, ~solid)
                plotter.add_mesh(
                    _creased(rest), opacity=opacity, show_edges=bool(edges), edge_opacity=0.5, line_width=1.0,
                    show_scalar_bar=False, **paint, **material,
                )  # fmt: skip
            if ghost is not None:
                gone = pyvista.PolyData.from_regular_faces(
                    _picture_coordinates(np.asarray(ghost.vertices), view, size), ghost.faces
                )
                plotter.add_mesh(_creased(gone), color=GHOST_COLOUR, opacity=GHOST_OPACITY, **material)
            if contour is not None:
                _add_contour(plotter, shape, *contour, radius=0.004 * size[0])
            if points is not None:
                _add_balls(plotter, vertices[points], 0.014 * size[0], material)
            if opacity < 1 or ghost is not None:
                plotter.enable_depth_peeling(number_of_peels=12)
            plotter.enable_anti_aliasing("ssaa")
            _look_along_z(plotter, vertices, size[1])
            return np.asarray(plotter.screenshot(return_img=True))
        finally:
            plotter.close()


def pixel_length(view: View, size: tuple[int, int] = TILE) -> float:
    """The length that a pixel of a picture spans, in the unit of the shape.

    Parameters
    ----------
    view : View
    size : (width, height)
        in pixels

    Examples
    --------
    >>> view = View(np.eye(3), np.zeros(3), np.array([92.0, 10.0]))
    >>> round(pixel_length(view, (100, 100)), 12)
    1.0
    """
    return float(max(view.extent[0] / size[0], view.extent[1] / size[1]) / (1 - 2 * MARGIN))


def visible_faces(mesh: trimesh.Trimesh, view: View, size: tuple[int, int] = (180, 150)) -> np.ndarray:
    """The face that is seen at each pixel.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    view : View
    size : (width, height)
        in pixels

    Returns
    -------
    (height, width) int array
        -1 where there is none

    Examples
    --------
    >>> import trimesh
    >>> from studies.figures.views import view_of
    >>> box = trimesh.creation.box()
    >>> seen = np.unique(visible_faces(box, view_of(box.vertices)))
    >>> seen[0], len(seen)  # the background, and the two triangles of each of the sides that face the camera
    (np.int64(-1), 5)
    """
    import pyvista

    vertices = _picture_coordinates(np.asarray(mesh.vertices), view, size)
    shape = pyvista.PolyData.from_regular_faces(vertices, mesh.faces)
    number = np.arange(len(mesh.faces))
    shape.cell_data["number"] = np.column_stack([number >> 16, number >> 8 & 255, number & 255]).astype(np.uint8)
    with pyvista.vtk_verbosity("off"):
        plotter = _lit_plotter(size)
        try:
            plotter.add_mesh(shape, scalars="number", rgb=True, lighting=False)
            plotter.disable_anti_aliasing()
            _look_along_z(plotter, vertices, size[1])
            picture = np.asarray(plotter.screenshot(return_img=True)).astype(np.int64)
        finally:
            plotter.close()
    seen = picture @ [1 << 16, 1 << 8, 1]
    return np.where(seen < len(mesh.faces), seen, -1)


def _picture_coordinates(vertices: np.ndarray, view: View, size: tuple[int, int]) -> np.ndarray:
    """Vertices turned to the camera, in pixels around the middle: a shape of any size and place renders alike."""
    return (vertices - view.centre) @ view.axes.T / pixel_length(view, size)


def _paint(
    shape: pyvista.PolyData,
    faces: np.ndarray,
    labels: np.ndarray | None,
    colours: np.ndarray | None,
    field: np.ndarray | None,
    field_range: tuple[float, float] | None,
) -> dict[str, Any]:
    """Attach what is shown to the shape: arguments that tell ``Plotter.add_mesh`` to show it."""
    if field is not None:
        shape.point_data["field"] = field
        return {"scalars": "field", "cmap": FIELD_COLOURS, "clim": field_range, "interpolate_before_map": True}
    shape.cell_data["colour"] = face_colours(labels, faces) if colours is None else colours[faces[:, 0]]
    return {"scalars": "colour", "rgb": True}


def _lit_plotter(size: tuple[int, int]) -> Any:
    """A pyvista.Plotter, untyped: the type hints of pyvista do not cover its decorated methods."""
    import pyvista

    plotter: Any = pyvista.Plotter(off_screen=True, window_size=list(size), lighting="none")
    plotter.background_color = "white"
    for position, intensity in LIGHTS:
        plotter.add_light(pyvista.Light(position=position, intensity=intensity, light_type="camera light"))
    return plotter


def _part(shape: pyvista.PolyData, chosen: np.ndarray) -> pyvista.PolyData:
    """Some of the faces of a shape: those of a (m,) bool array."""
    cells: Any = np.flatnonzero(chosen)
    return shape.extract_cells(cells).extract_surface(algorithm=None)


def _add_contour(plotter: Any, shape: pyvista.PolyData, values: np.ndarray, level: float, radius: float) -> None:
    """A black tube along the line at which the values have this level."""
    shape.point_data["contour"] = values
    line = shape.contour([level], scalars="contour")
    if line.n_points:
        plotter.add_mesh(line.tube(radius=radius), color="black", lighting=False)


def _add_balls(plotter: Any, centres: np.ndarray, radius: float, material: dict[str, Any]) -> None:
    import pyvista

    ball = pyvista.Sphere(radius=radius)
    balls = pyvista.PolyData(centres).glyph(geom=ball, scale=False, orient=False)
    plotter.add_mesh(balls, color=MARK_COLOUR, **material)


def _creased(shape: pyvista.PolyData) -> pyvista.PolyData:
    """The shape with smooth normals, except at sharp creases such as the edges of a machine part."""
    return shape.compute_normals(
        cell_normals=False,
        split_vertices=True,
        feature_angle=CREASE,
        consistent_normals=False,
        auto_orient_normals=False,
    )


def _look_along_z(plotter: Any, vertices: np.ndarray, height: int) -> None:
    """Show this many pixels, each one unit high, around the origin, with everything between the clipping planes."""
    far = 2 * np.abs(vertices).max() + height
    camera = plotter.camera
    camera.focal_point, camera.position, camera.up = (0, 0, 0), (0, 0, far), (0, 1, 0)
    camera.enable_parallel_projection()
    camera.parallel_scale = height / 2
    camera.clipping_range = (0.01 * far, 2 * far)
