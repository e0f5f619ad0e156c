import numpy as np
import pytest

import heatwalk
from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from heatwalk.meshes import mesh_edges
from heatwalk.robust.options import Options
from heatwalk.robust.parts import potential, waists
from heatwalk.spectrum import SpectrumSolver
from tests.helpers.meshes import bundled
from tests.helpers.parts import agreement, chain, star

BORDERS = Options(refine=True)
HIERARCHY = Options(refine=True, hierarchy=True)


RADII = (1.0, 0.6, 0.8, 0.7)


@pytest.fixture(scope="module")
def balls():
    """A head, and a tail of three joints, of which the walk sees one."""
    return chain(RADII, neck=0.35)


@pytest.fixture(scope="module")
def seg(balls):
    return heatwalk.segment_robust(*balls[:2], options=HIERARCHY)


@pytest.fixture(scope="module")
def coarse(balls):
    return heatwalk.segment_robust(*balls[:2], options=BORDERS)


def test_every_joint_of_a_tail_is_a_part(balls, seg, coarse):
    assert len(coarse.exemplars) == 2
    assert agreement(coarse.labels, balls[2]) < 0.8
    assert seg.n_segments == len(RADII)
    assert agreement(seg.labels, balls[2]) > 0.99


@pytest.mark.parametrize("radii", [(0.6, 0.8, 1.1, 0.8, 0.6), (0.8, 0.6, 1.0, 0.6, 0.6, 0.5)])
def test_every_ball_of_a_row_is_a_part(radii):
    vertices, faces, ball = chain(radii, neck=0.35)
    found = heatwalk.segment_robust(vertices, faces, options=HIERARCHY)
    assert agreement(found.labels, ball) > 0.97


def test_arms_without_wrists_are_not_cut():
    vertices, faces, _ = star()
    seg = heatwalk.segment_robust(vertices, faces, options=HIERARCHY)
    assert len(seg.exemplars) == 4
    assert (seg.parts.parents == 4).all()


def test_the_cut_of_a_part_encloses_it_with_the_parts_within_it(balls, seg):
    parents, labels = seg.parts.parents, seg.parts.labels
    edges = mesh_edges(seg.repaired.faces)[0]
    assert (parents < len(parents)).any()
    for part in range(len(parents)):
        enclosed = np.isin(labels, [part, *np.flatnonzero(parents == part)])
        assert len(np.unique(vertex_components(len(labels), edges[enclosed[edges].all(axis=1)])[enclosed])) == 1


@pytest.mark.parametrize("name", ["balls", "cow"])
def test_the_hierarchy_refines_the_segmentation_without_it(name, balls, seg, coarse):
    fine, whole = seg, coarse
    if name == "cow":
        cow = bundled("cow")
        fine, whole = (heatwalk.segment_robust(cow.vertices, cow.faces, options=o) for o in (HIERARCHY, BORDERS))
    assert fine.n_segments > whole.n_segments
    for part in np.unique(fine.labels):
        assert np.bincount(whole.labels[fine.labels == part]).max() > 0.9 * np.count_nonzero(fine.labels == part)


@pytest.mark.parametrize("options", [BORDERS, Options(hierarchy=True), HIERARCHY])
def test_the_result_is_as_that_of_every_segmentation(balls, options):
    vertices, faces, _ = balls
    seg = heatwalk.segment_robust(vertices, faces, options=options)
    k = len(seg.exemplars)
    assert seg.accumulator_labels[seg.exemplars].tolist() == list(range(k))
    assert np.array_equal(seg.dissipates, seg.labels == k)
    assert np.array_equal(seg.labels[~seg.dissipates], seg.accumulator_labels[~seg.dissipates])
    assert ((seg.margin >= 0) & (seg.margin <= 1)).all()


def test_labels_do_not_depend_on_the_orientation_of_faces(balls, seg):
    vertices, faces, _ = balls
    turned = np.where(np.random.default_rng(0).random(len(faces))[:, None] < 0.5, faces, faces[:, ::-1])
    again = heatwalk.segment_robust(vertices, turned, options=HIERARCHY)
    assert agreement(again.labels, seg.labels) > 0.99


def test_margins_are_small_at_cuts_and_large_at_tips(balls, seg):
    edges = mesh_edges(balls[1])[0]
    at_cut = np.unique(edges[seg.labels[edges[:, 0]] != seg.labels[edges[:, 1]]])
    assert np.median(seg.margin[at_cut]) < 0.5 * np.median(seg.margin)


def test_the_potential_solves_its_equation():
    """L g = δ - mass / area, with all eigenpairs, and no spot."""
    vertices, faces, _ = star(subdivisions=2)
    stiffness, mass = stiffness_and_mass(unit_area(vertices, faces), faces)
    spectrum = SpectrumSolver(stiffness, mass, np.zeros(len(mass), int)).up_to(1e12)
    source = np.eye(len(mass))[5]
    assert stiffness @ potential(spectrum, 5, time=0.0) == pytest.approx(source - mass / mass.sum(), abs=1e-8)


@pytest.mark.parametrize("seed", range(10))
def test_waists_are_the_minima_with_barriers_on_both_sides(seed):
    costs = np.exp(np.random.default_rng(seed).normal(0, 0.3, 40).cumsum())
    expected = []
    for at in range(1, 39):
        barriers = []
        for step in (-1, 1):
            i, highest = at, costs[at]
            while 0 <= i + step < 40 and costs[i + step] >= costs[at]:
                i += step
                highest = max(highest, costs[i])
            barriers.append(highest / costs[at])
        if min(barriers) >= 1.3 and costs[at] < min(costs[at - 1], costs[at + 1]):
            expected.append((at, pytest.approx(min(barriers))))
    assert [(waist.at, waist.prominence) for waist in waists(costs, 1.3)] == expected
