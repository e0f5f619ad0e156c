"""The surface of a mesh of cells of any kind, as VTK and Gmsh store them: its faces, and the boundary of its volume."""

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.polygons import Polygons, RawMesh, check_corners, raw_mesh
from heatwalk.meshes import MeshError

STRIP, POLYGON, PIXEL, VOXEL = 6, 7, 8, 11

# Types of cells by VTK's numbers. Those of higher order list their corners first, which are all that is read.
_POINTS_AND_LINES = (0, 1, 2, 3, 4, 21, 35, 68, 75)
_TRIANGLES = (5, 22, 34, 69, 76)
_QUADS = (8, 9, 23, 28, 30, 70, 77)
_TETRAHEDRA = (10, 24, 71, 78)
_HEXAHEDRA = (11, 12, 25, 29, 33, 72, 79)
_WEDGES = (13, 26, 31, 32, 73, 80)
_PYRAMIDS = (14, 27, 37, 74, 81)
_LINEAR = (*range(17),)
_N_CORNERS = {
    **dict.fromkeys(_TRIANGLES, 3), **dict.fromkeys(_QUADS, 4), **dict.fromkeys(_TETRAHEDRA, 4),
    **dict.fromkeys(_HEXAHEDRA, 8), **dict.fromkeys(_WEDGES, 6), **dict.fromkeys(_PYRAMIDS, 5), 15: 10, 16: 12,
}  # fmt: skip


def _prism(n_sides: int) -> list[tuple[int, ...]]:
    """The faces of a prism over a polygon of 0 … n-1."""
    sides = [(i, (i + 1) % n_sides, n_sides + (i + 1) % n_sides, n_sides + i) for i in range(n_sides)]
    return [tuple(range(n_sides)), tuple(range(n_sides, 2 * n_sides)), *sides]


# The faces of each volume cell, in any orientation.
_FACES: dict[int, list[tuple[int, ...]]] = {
    **{kind: [(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)] for kind in _TETRAHEDRA},
    **{kind: _prism(4) for kind in _HEXAHEDRA},
    **{kind: _prism(3) for kind in _WEDGES},
    **{kind: [(0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)] for kind in _PYRAMIDS},
    15: _prism(5),
    16: _prism(6),
}


def surface_mesh(vertices: NDArray, kinds: NDArray[np.integer], cells: Polygons) -> RawMesh:
    """The faces among the cells, and those faces of volume cells that belong to one of them only.

    Parameters
    ----------
    vertices : (n, 3) float array
    kinds : (c,) int array
        the type of each cell, by VTK's numbers
    cells : Polygons
        the number of vertices of each cell, and all their vertices
    """
    _check_cells(kinds, cells, len(vertices))
    if _are_plain_faces(kinds, cells):
        return raw_mesh(vertices, cells)
    starts = np.cumsum(cells.sizes) - cells.sizes
    faces = _faces(kinds, cells, starts)
    is_volume = np.isin(kinds, list(_FACES))
    boundary = _boundary(vertices, kinds, cells.corners, starts, is_volume, faces)
    polygons = Polygons(
        np.concatenate([faces.sizes, boundary.sizes]), np.concatenate([faces.corners, boundary.corners])
    )
    n_volume, n_faces, n_boundary = int(np.count_nonzero(is_volume)), len(faces.sizes), len(boundary.sizes)
    notes = []
    volume = _count(n_volume, "volume cell")
    if n_volume and not n_faces:
        notes.append(f"took the {n_boundary:,} boundary faces of {volume}")
    elif n_volume and not n_boundary:
        notes.append(f"ignored {volume}, whose boundary is among the faces of the file")
    elif n_volume:
        added = _count(n_boundary, "boundary face")
        notes.append(f"added {added} of {volume} to the {_count(n_faces, 'face')} of the file")
    n_lower = int(np.count_nonzero(np.isin(kinds, _POINTS_AND_LINES)))
    if n_lower:
        notes.append(f"ignored {_count(n_lower, 'cell')} of points or lines")
    n_higher = int(np.count_nonzero(~np.isin(kinds, (*_LINEAR, *_POINTS_AND_LINES))))
    if n_higher:
        notes.append(f"read {_count(n_higher, 'cell')} of higher order by the corners alone")
    return raw_mesh(vertices, polygons, tuple(notes))


def _are_plain_faces(kinds: NDArray[np.integer], cells: Polygons) -> bool:
    """Whether the cells are polygons alone, or triangles alone, as in most files."""
    if not len(kinds) or not (kinds == kinds[0]).all():
        return False
    return bool(kinds[0] == POLYGON or (kinds[0] == _TRIANGLES[0] and (cells.sizes == 3).all()))


def _count(count: int, noun: str) -> str:
    """A number with its noun in singular or plural."""
    return f"{count:,} {noun}{'s' * (count != 1)}"


def _check_cells(kinds: NDArray[np.integer], cells: Polygons, n_vertices: int) -> None:
    """Raise MeshError for a cell of a type that is not read, with too few vertices, or with one that is not there."""
    known = (*_POINTS_AND_LINES, *_N_CORNERS, STRIP, POLYGON)
    unknown = np.flatnonzero(~np.isin(kinds, known))
    if len(unknown):
        names = {36: "quadratic polygons", 41: "convex point sets", 42: "polyhedra"}
        name = names.get(int(kinds[unknown[0]]), f"cells of VTK's type {kinds[unknown[0]]}")
        raise MeshError(f"contains {name}, which are not read; export its surface as triangles or polygons")
    required = np.zeros(max(known) + 1, dtype=np.int64)
    required[list(_N_CORNERS)] = list(_N_CORNERS.values())
    short = np.flatnonzero(cells.sizes < required[kinds])
    if len(short):
        i = short[0]
        raise MeshError(
            f"cell {i} (counted from 0) has {cells.sizes[i]} vertices, but its type requires {required[kinds[i]]}"
        )
    check_corners(cells, n_vertices, "cell")


def _faces(kinds: NDArray[np.integer], cells: Polygons, starts: NDArray[np.int64]) -> Polygons:
    """The cells that are faces, in their order; strips are several."""
    counts = np.zeros(max(*_N_CORNERS, POLYGON) + 1, dtype=np.int64)
    counts[list(_TRIANGLES)], counts[list(_QUADS)] = 3, 4
    sizes = np.where(np.isin(kinds, (POLYGON, STRIP)), cells.sizes, counts[np.minimum(kinds, len(counts) - 1)])
    chosen = np.flatnonzero(sizes)
    runs = Polygons(sizes[chosen], _runs(cells.corners, starts[chosen], sizes[chosen]))
    kinds = kinds[chosen]
    if not np.isin(kinds, (PIXEL, STRIP)).any():
        return runs
    rings: list[list[int]] = []
    ends = np.cumsum(runs.sizes).tolist()
    corners = runs.corners.tolist()
    for kind, size, end in zip(kinds.tolist(), runs.sizes.tolist(), ends, strict=True):
        ring = corners[end - size : end]
        if kind == PIXEL:
            rings.append([ring[0], ring[1], ring[3], ring[2]])
        elif kind == STRIP:
            rings += strip_triangles(ring)
        else:
            rings.append(ring)
    return as_polygons(rings)


def strip_triangles(strip: list[int]) -> list[list[int]]:
    """The triangles of a strip; every second one is turned over."""
    return [
        [strip[i], strip[i + 1], strip[i + 2]] if i % 2 == 0 else [strip[i + 1], strip[i], strip[i + 2]]
        for i in range(len(strip) - 2)
    ]


def as_polygons(rings: list[list[int]]) -> Polygons:
    """Lists of corners as arrays."""
    sizes = np.array([len(ring) for ring in rings], dtype=np.int64)
    return Polygons(sizes, np.array([corner for ring in rings for corner in ring], dtype=np.int64))


def _runs(values: NDArray[np.int64], starts: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """The runs of the given sizes that begin at ``starts``, one after the other."""
    return values[np.repeat(starts - np.cumsum(sizes) + sizes, sizes) + np.arange(sizes.sum())]


def _boundary(
    vertices: NDArray,
    kinds: NDArray[np.integer],
    corners: NDArray[np.int64],
    starts: NDArray[np.int64],
    is_volume: NDArray[np.bool_],
    faces: Polygons,
) -> Polygons:
    """The faces of volume cells that belong to one of them only and are not among ``faces``, facing outwards."""
    sides: dict[int, list[NDArray[np.int64]]] = {}
    insides: dict[int, list[NDArray[np.float64]]] = {}
    for kind in np.unique(kinds[is_volume]).tolist():
        cells = corners[starts[kinds == kind][:, None] + np.arange(_N_CORNERS[kind])]
        if kind == VOXEL:
            cells = cells[:, [0, 1, 3, 2, 4, 5, 7, 6]]
        centres = np.asarray(vertices, dtype=np.float64)[cells].mean(axis=1)
        for side in _FACES[kind]:
            sides.setdefault(len(side), []).append(cells[:, side])
            insides.setdefault(len(side), []).append(centres)
    found = [Polygons(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))]
    for size, parts in sides.items():
        rings = np.vstack(parts)
        key = np.sort(np.vstack([rings, _rings_of_size(faces, size)]), axis=1)
        alone = np.flatnonzero(_occurs_once(key)[: len(rings)])
        outward = _facing_away(vertices, rings[alone], np.vstack(insides[size])[alone])
        found.append(Polygons(np.full(len(outward), size, dtype=np.int64), outward.ravel()))
    return Polygons(*(np.concatenate(arrays) for arrays in zip(*found, strict=True)))


def _occurs_once(rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether each row of an (n, k) array differs from all others; faster than NumPy's unique rows."""
    order = np.lexsort(rows.T)
    same = np.append((rows[order[1:]] == rows[order[:-1]]).all(axis=1), False)
    repeated = np.empty(len(rows), dtype=bool)
    repeated[order] = same | np.append(False, same[:-1])
    return ~repeated


def _rings_of_size(faces: Polygons, size: int) -> NDArray[np.int64]:
    """The polygons of a number of corners, (p, size)."""
    starts = (np.cumsum(faces.sizes) - faces.sizes)[faces.sizes == size]
    return faces.corners[starts[:, None] + np.arange(size)]


def _facing_away(vertices: NDArray, rings: NDArray[np.int64], insides: NDArray[np.float64]) -> NDArray[np.int64]:
    """Rings (p, k) turned over where they face the points ``insides``: formats differ in the order of corners."""
    points = np.asarray(vertices, dtype=np.float64)[rings]
    with np.errstate(all="ignore"):
        normals = np.cross(points[:, 1:-1] - points[:, :1], points[:, 2:] - points[:, :1]).sum(axis=1)
        inward = ((points.mean(axis=1) - insides) * normals).sum(axis=1) < 0
    return np.where(inward[:, None], rings[:, ::-1], rings)
