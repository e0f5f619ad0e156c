"""What the readers of the mesh formats share: their result, checks of its completeness, and triangulation."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.meshes import MeshError

# A fan is kept if none of its triangles is turned over by more than this fraction of the polygon's area: corners that
# rounding moves off a straight side do not make a polygon concave.
_TURNED_OVER = 1e-9

# Triangles of a polygon that does not cross itself have its area, up to this fraction.
_SAME_AREA = 1e-6


class RawMesh(NamedTuple):
    """The contents of a mesh file: vertices (n, 3), triangles (m, 3), the number of polygons, and what was ignored."""

    vertices: NDArray
    faces: NDArray
    n_polygons: int
    notes: tuple[str, ...] = ()


class Polygons(NamedTuple):
    """Polygons of any size: the number of corners of each, (m,), and all corners one after the other."""

    sizes: NDArray[np.int64]
    corners: NDArray[np.int64]


def check_complete(n_declared: int, n_found: int, kind: str = "faces") -> None:
    """Raise MeshError if a file contains fewer elements than it declares."""
    if n_found < n_declared:
        raise MeshError(f"declares {n_declared:,} {kind} but contains {n_found:,}: the file is truncated")


def surplus_note(surplus: bytes, record_size: int, kind: str) -> tuple[str, ...]:
    """Note on the bytes after the last declared record; MeshError if they look like more records.

    Parameters
    ----------
    surplus : bytes
        what follows the last record
    record_size : int
        bytes of one more record
    kind : str
        what the records are, in the plural
    """
    if not surplus.strip(b"\0\x1a \t\r\n"):
        return ()
    if record_size and len(surplus) % record_size == 0:
        n_more = len(surplus) // record_size
        raise MeshError(
            f"contains {n_more:,} more {kind} than its header declares: correct the number of {kind} in the header, or "
            "export the file again"
        )
    return (f"ignored {len(surplus):,} byte{'s' * (len(surplus) != 1)} after the last of the {kind}",)


def raw_mesh(vertices: NDArray, polygons: Polygons, notes: tuple[str, ...] = ()) -> RawMesh:
    """Triangulated polygons, after a check of their corners: the message counts the polygons of the file."""
    check_corners(polygons, len(vertices), "face")
    faces, n_crossing = triangulate(vertices, polygons)
    if n_crossing == 1:
        notes += ("1 face crosses itself: it became a fan, whose triangles overlap",)
    elif n_crossing:
        notes += (f"{n_crossing:,} faces cross themselves: they became fans, whose triangles overlap",)
    return RawMesh(vertices, faces, len(polygons.sizes), notes)


def check_corners(polygons: Polygons, n_vertices: int, kind: str) -> None:
    """Raise MeshError for the first polygon, or other ``kind`` of cell, with a corner that is not a vertex."""
    invalid = (polygons.corners < 0) | (polygons.corners >= n_vertices)
    if invalid.any():
        first = int(np.argmax(invalid))
        polygon = int(np.searchsorted(np.cumsum(polygons.sizes), first, side="right"))
        raise MeshError(
            f"{kind} {polygon} (counted from 0) refers to vertex {polygons.corners[first]}, but there are {n_vertices} "
            "vertices"
        )


class _Triangulation(NamedTuple):
    """Triangles (t, 3), and the number of polygons that cross themselves."""

    faces: NDArray[np.int64]
    n_crossing: int


def triangulate(vertices: NDArray, polygons: Polygons) -> _Triangulation:
    """Triangles of polygons of any size: triangles first, then the halves of quads, then the rest.

    Polygons with at least four corners become fans around their first corner (quads: halves along the diagonal from
    it), unless the fan would leave the polygon. Then the polygon is concave, and ears are clipped from its projection
    to the plane that its area vector is normal to. One that crosses itself stays a fan. Polygons with fewer than three
    corners have no triangles.
    """
    sizes, corners = polygons
    if (sizes == 3).all():
        return _Triangulation(corners.reshape(-1, 3), 0)
    n_crossing = 0
    starts = np.cumsum(sizes) - sizes
    triangles = corners[starts[sizes == 3][:, None] + np.arange(3)]
    quads = corners[starts[sizes == 4][:, None] + np.arange(4)]
    halves = _halves(quads)
    n_quads = len(quads)
    for i in np.flatnonzero(_leaves_polygon(vertices, quads)):
        ears = _clip_ears(vertices, quads[i])
        if ears is None:
            n_crossing += 1
        else:
            halves[[i, n_quads + i]] = ears

    large = np.flatnonzero(sizes > 4)
    fan_sizes = sizes[large] - 2
    fan_starts = np.cumsum(fan_sizes) - fan_sizes
    step = np.arange(fan_sizes.sum()) - np.repeat(fan_starts, fan_sizes)
    first = np.repeat(starts[large], fan_sizes)
    fans = corners[np.column_stack([first, first + step + 1, first + step + 2])]
    for size in np.unique(sizes[large]):
        same = np.flatnonzero(sizes[large] == size)
        rings = corners[starts[large[same]][:, None] + np.arange(size)]
        for i in np.flatnonzero(_leaves_polygon(vertices, rings)):
            ears = _clip_ears(vertices, rings[i])
            at = fan_starts[same[i]]
            if ears is None:
                n_crossing += 1
            else:
                fans[at : at + size - 2] = ears
    return _Triangulation(np.vstack([triangles, halves, fans]), n_crossing)


def _halves(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangles of (q, 4) quads: the first half of each, then the second half of each."""
    return np.vstack([quads[:, [0, 1, 2]], quads[:, [2, 3, 0]]])


def _relative(vertices: NDArray, rings: NDArray[np.int64]) -> NDArray[np.float64]:
    """Corners of (p, k) rings relative to their first corner and the extent of the ring, (p, k, 3)."""
    with np.errstate(all="ignore"):  # coordinates may be infinite or NaN here
        points = np.asarray(vertices, dtype=np.float64)[rings]
        points = points - points[:, :1]
        extent = np.abs(points).max(axis=(1, 2), keepdims=True)
        return points / np.where(extent > 0, extent, 1)


def _leaves_polygon(vertices: NDArray, rings: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether the fan around the first corner of each of the (p, k) rings leaves the polygon, (p,).

    In the projection along the area vector, such a fan has a triangle that is turned over. Or the area vector vanishes
    though those of the triangles do not.
    """
    points = _relative(vertices, rings)
    with np.errstate(all="ignore"):
        areas = np.cross(points[:, 1:-1], points[:, 2:])  # twice the area vectors of the fan's triangles
        total = areas.sum(axis=1, keepdims=True)
        along = (areas * total).sum(axis=2)
        square = (total**2).sum(axis=(1, 2))
        parts = np.linalg.norm(areas, axis=2).sum(axis=1)
        cancels = (parts > _TURNED_OVER) & (square <= (_TURNED_OVER * parts) ** 2)
        return cancels | (along.min(axis=1) < -_TURNED_OVER * square)


def _clip_ears(vertices: NDArray, ring: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Triangles of one concave polygon of k corners, (k - 2, 3), in its orientation; None if it crosses itself."""
    from mapbox_earcut import triangulate_float64

    points = _relative(vertices, ring[None])[0]
    flat = _project(points)
    found = triangulate_float64(flat, np.array([len(ring)], dtype=np.uint32)).reshape(-1, 3).astype(np.int64)
    if not len(found):
        return None
    x, y = flat.T
    total = float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    a, b, c = flat[found].transpose(1, 0, 2)
    doubled = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    if not abs(np.abs(doubled).sum() - abs(total)) <= _SAME_AREA * abs(total):
        return None
    if doubled.sum() < 0:
        found = found[:, ::-1]
    triangles = _with_all_corners(found.tolist(), len(ring))
    return ring[np.array(triangles, dtype=np.int64)] if len(triangles) == len(ring) - 2 else None


def _project(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates of (k, 3) corners in the plane normal to their area vector, (k, 2), counterclockwise."""
    normal = np.cross(points[1:-1], points[2:]).sum(axis=0)
    normal /= np.linalg.norm(normal) or 1.0
    axis = np.eye(3)[np.argmin(np.abs(normal))]
    first = np.cross(axis, normal)
    first /= np.linalg.norm(first) or 1.0
    return np.ascontiguousarray(np.column_stack([points @ first, points @ np.cross(normal, first)]))


def _with_all_corners(triangles: list[list[int]], size: int) -> list[list[int]]:
    """Triangles that contain every corner: ear clipping can leave out corners on a straight side.

    Each missing corner splits the triangle at that side.
    """
    present = sorted({corner for triangle in triangles for corner in triangle})
    for before, after in zip(present, [*present[1:], present[0] + size], strict=True):
        end = after % size
        for corner in range(before + 1, after):
            start = (corner - 1) % size
            for i, triangle in enumerate(triangles):
                turned = [triangle[j:] + triangle[:j] for j in range(3)]
                side = next((t for t in turned if t[:2] == [start, end]), None)
                if side is not None:
                    triangles[i] = [start, corner % size, side[2]]
                    triangles.append([corner % size, end, side[2]])
                    break
    return triangles
