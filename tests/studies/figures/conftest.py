import numpy as np
import pytest

import perturb
from studies.datasets.bundled import Bundled
from studies.experiments.change import Reference
from studies.figures.views import view_of
from studies.segmenters.heat_walk import HeatWalk


@pytest.fixture(scope="session")
def cow():
    """The bundled cow and its labels, as a trial's reference."""
    loaded = Bundled(["cow"]).models()[0].load()
    mesh = perturb.as_trimesh(loaded.vertices, loaded.faces)
    return Reference(mesh, HeatWalk()(loaded.vertices, loaded.faces))


@pytest.fixture(scope="session")
def view(cow):
    return view_of(np.asarray(cow.mesh.vertices))
