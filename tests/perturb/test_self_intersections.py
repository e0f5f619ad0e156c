"""Self-intersections: bumps come out on the opposite side, and faces really intersect."""

import numpy as np
import pytest
import trimesh

import perturb
from perturb import PerturbationError
from perturb._odd_meshes import ellipsoid
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import distances_along_edges, rng


@pytest.fixture(scope="module")
def mesh():
    return perturb.as_trimesh(*ellipsoid())


BUMPS = perturb.SelfIntersections(2, radius=0.1, thickness=0.5)


@pytest.fixture(scope="module")
def result(mesh):
    return BUMPS(mesh, rng())


def pierced(mesh):
    """(m,) bool: faces that an edge of another face passes through, or whose edge passes through another face."""
    corners, faces = mesh.triangles, mesh.faces
    edges = mesh.edges_unique
    origin, direction = mesh.vertices[edges[:, 0]], np.diff(mesh.vertices[edges], axis=1)[:, 0]
    low, high = mesh.vertices[edges].min(axis=1), mesh.vertices[edges].max(axis=1)
    found = np.zeros(len(faces), dtype=bool)
    for number, (face, (a, b, c)) in enumerate(zip(faces, corners, strict=True)):
        overlaps = (low <= np.max([a, b, c], axis=0)) & (high >= np.min([a, b, c], axis=0))
        others = np.flatnonzero(overlaps.all(axis=1) & ~np.isin(edges, face).any(axis=1))
        basis = np.stack(np.broadcast_arrays(b - a, c - a, -direction[others]), axis=2)
        regular = np.abs(np.linalg.det(basis)) > 1e-15
        others, basis = others[regular], basis[regular]
        u, v, t = np.linalg.solve(basis, (origin[others] - a)[..., None])[..., 0].T
        through = others[(u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)]
        found[number] |= len(through) > 0
        for edge in edges[through]:
            found |= np.isin(faces, edge).sum(axis=1) == 2
    return found


def test_the_faces_that_are_said_to_intersect_are_those_that_an_edge_passes_through(mesh, result):
    assert result.applied["intersecting_faces_before"] == np.count_nonzero(pierced(mesh)) == 0
    assert result.applied["intersecting_faces"] == np.count_nonzero(pierced(result.mesh)) > 0


def test_a_bump_is_what_is_within_the_radius_along_the_edges(mesh, result):
    reach = 0.1 * np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    tips = BUMPS.sample(mesh, rng())["vertices"]
    near = [distances_along_edges(mesh, tip) < reach for tip in tips]
    np.testing.assert_array_equal((result.mesh.vertices != mesh.vertices).any(axis=1), near[0] | near[1])
    assert not (near[0] & near[1]).any()


def test_the_tip_comes_out_by_the_protrusion(mesh, result):
    diagonal = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    for tip in BUMPS.sample(mesh, rng())["vertices"]:
        start, end = mesh.vertices[tip], result.mesh.vertices[tip]
        direction = (end - start) / np.linalg.norm(end - start)
        # The exit of a convex polyhedron along a ray: the nearest of the planes towards which the ray goes.
        slope = mesh.face_normals @ direction
        height = np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles[:, 0] - start)
        depth = (height[slope > 1e-9] / slope[slope > 1e-9]).min()
        assert np.linalg.norm(end - start) == pytest.approx(depth + 0.03 * diagonal, rel=1e-6)


@pytest.mark.parametrize("name", ["bone", "cow"])  # without self-intersections, and with some
def test_every_bump_of_a_real_mesh_makes_more_faces_intersect(name):
    for amount in (1, 4, 8):
        applied = perturb.SelfIntersections(amount)(bundled(name), rng()).applied
        assert applied["intersecting_faces"] - applied["intersecting_faces_before"] >= 5 * amount


def test_bumps_that_intersect_nothing_are_refused(mesh):
    inwards = {"vertices": np.array([0]), "depths": np.array([0.01])}
    with pytest.raises(PerturbationError, match="1 of 1 bumps would not intersect the surface"):
        perturb.SelfIntersections(1, radius=0.1, protrusion=0.01).apply(mesh, inwards)


def test_more_bumps_than_fit_are_refused(mesh):
    with pytest.raises(PerturbationError, match=r"500 bumps were requested, but only \d+ were found"):
        perturb.SelfIntersections(500, thickness=0.5)(mesh, rng())


def test_a_sheet_has_no_opposite_side():
    sheet = trimesh.creation.box(extents=[1, 1, 0.1]).subdivide().subdivide().subdivide()
    upper = np.flatnonzero(sheet.triangles_center[:, 2] > 0.04)
    with pytest.raises(PerturbationError, match="only 0 were found"):
        perturb.SelfIntersections(1)(sheet.submesh([upper], append=True, repair=False), rng())
