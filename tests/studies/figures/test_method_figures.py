import numpy as np
import pytest
import trimesh

import heatwalk
from heatwalk.accumulators import blocked_maximum_inner_products
from studies.datasets.bundled import Bundled
from studies.figures import curves as figures
from studies.figures import plates


@pytest.fixture(scope="module")
def ant():
    loaded = Bundled(["ant"]).models()[0].load()
    return trimesh.Trimesh(loaded.vertices, loaded.faces, process=False)


@pytest.fixture(scope="module")
def segmented(ant):
    return heatwalk.segment(ant.vertices, ant.faces)


def test_the_settled_shares_are_those_counted_vertex_by_vertex_on_the_walk(segmented):
    pointer, _ = blocked_maximum_inner_products(segmented.kernel)
    settled = []
    for vertex in range(len(pointer)):
        steps = 0
        while pointer[vertex] != vertex:
            vertex, steps = pointer[vertex], steps + 1
        settled.append(steps)
    shares = segmented.walk.settled_shares()
    expected = [np.mean(np.array(settled) <= step) for step in range(max(settled) + 1)]
    np.testing.assert_array_equal(shares, expected)
    assert shares[-1] == 1


def test_the_diffusion_radius_of_a_sphere_is_that_of_its_heat_by_colatitude():
    """Between the radii at which less and more than 90 % of the heat are within, from the distances known exactly."""
    sphere = trimesh.creation.icosphere(4)
    kernel = heatwalk.segment(sphere.vertices, sphere.faces, 0.5).kernel
    radius, distance = plates.diffusion_radius(sphere, kernel, 7)
    colatitude = np.arccos(np.clip(sphere.vertices @ sphere.vertices[7], -1, 1)) / np.sqrt(4 * np.pi)
    np.testing.assert_allclose(distance, colatitude, atol=0.02)
    heat = kernel.mass * (kernel.factor @ kernel.factor[7])
    assert heat.sum() == pytest.approx(1)
    assert heat[colatitude < radius - 0.02].sum() < 0.9 < heat[colatitude < radius + 0.02].sum()


def test_heat_stays_on_its_component():
    sphere = trimesh.creation.icosphere(3)
    both = trimesh.util.concatenate([sphere, sphere.copy().apply_translation([3, 0, 0])])
    kernel = heatwalk.segment(both.vertices, both.faces).kernel
    _, distance = plates.diffusion_radius(both, kernel, 0)
    assert np.array_equal(np.isfinite(distance), np.arange(len(distance)) < len(sphere.vertices))


def test_the_plates_state_what_the_segmentation_says(ant, segmented):
    later = heatwalk.segment(ant.vertices, ant.faces, 2.0)
    _, pipeline = plates.pipeline(ant, segmented)
    assert pipeline["accumulator_regions"] == len(segmented.exemplars)
    assert pipeline["dissipator_share"] == np.mean(plates.segments(segmented) == -1)
    _, walk = plates.walk(ant, segmented)
    assert walk["exemplars"] == [len(np.unique(stands)) for stands in segmented.walk.steps]
    _, over_time = plates.over_time(ant, [segmented, later], segmented)
    assert over_time["segments"] == {1.0: segmented.n_segments, 2.0: later.n_segments}
    assert over_time["change"][1.0] == 0


def test_a_plate_has_the_same_bytes_again(ant, segmented, tmp_path):
    for name in ("first", "second"):
        figure, _ = plates.showcase([(ant, plates.segments(segmented), "ant")])
        figures.save(figure, tmp_path / f"{name}.png", "ant")
    assert (tmp_path / "first.png").read_bytes() == (tmp_path / "second.png").read_bytes()
