"""Real surfaces with any number of vertices, for measuring."""

import fast_simplification
import numpy as np
import trimesh

from studies.datasets.bundled import Bundled


def surface(n_vertices, model="ant"):
    """A bundled mesh with about ``n_vertices``: decimated, then refined by Loop subdivision, which quadruples it.

    Returns
    -------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    """
    (bundled,) = Bundled([model]).models()
    mesh = bundled.load()
    refinements = max(0, int(np.ceil(np.log2(n_vertices / len(mesh.vertices)) / 2)))
    # A closed surface of genus 0 has 2 n − 4 faces.
    vertices, faces = fast_simplification.simplify(
        mesh.vertices, mesh.faces, target_count=2 * n_vertices // 4**refinements
    )
    for _ in range(refinements):
        vertices, faces = trimesh.remesh.subdivide_loop(vertices, faces, iterations=1)
    return np.asarray(vertices, dtype=float), np.asarray(faces, dtype=np.int64)
