import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh

import heatwalk
from heatwalk.accumulators import TIE
from heatwalk.laplacian import stiffness_and_mass, unit_area
from tests.helpers.surfaces import surface


@pytest.mark.slow
def test_a_million_vertices_are_segmented_exactly():
    vertices, faces = surface(1_000_000)
    seg = heatwalk.segment(vertices, faces)

    found = seg.spectrum.eigenvalues[0]
    stiffness, mass = stiffness_and_mass(unit_area(vertices, faces), faces)
    expected = eigsh(stiffness, len(found), sp.diags_array(mass).tocsc(), sigma=-1, return_eigenvectors=False)
    np.testing.assert_allclose(found, np.sort(expected), rtol=1e-7, atol=1e-6)

    kernel, walk = seg.kernel, seg.walk
    for x in np.random.default_rng(0).integers(len(vertices), size=300):
        heat = kernel.factor @ kernel.factor[x]
        assert walk.pointer[x] == np.flatnonzero(heat >= heat.max() * (1 - TIE))[0]
        assert walk.potential[x] == pytest.approx(heat.max(), rel=1e-12)
    assert np.array_equal(walk.exemplars, np.flatnonzero(walk.pointer == np.arange(len(vertices))))
    assert np.array_equal(walk.labels, walk.labels[walk.pointer])
    assert np.array_equal(walk.labels[walk.exemplars], np.arange(len(walk.exemplars)))
