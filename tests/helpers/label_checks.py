"""Checks that methods which find parts of a surface share."""

import numpy as np
from scipy.spatial.transform import Rotation

from perturb.testing import odd_meshes
from studies.metrics.psb import rand_index_error
from studies.testing import example_meshes


def errors_on_odd_meshes(method, *told):
    """For each odd mesh what is wrong with the labels of the faces, if anything: neither labels nor a plain refusal."""
    errors = {}
    for name, mesh in odd_meshes().items():
        vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
        try:
            labels = method(vertices, faces, *told)
        except ValueError as error:
            if "\n" in str(error):
                errors[name] = str(error)
            continue
        if labels.shape != (len(faces),) or labels.dtype != np.int64 or labels.min() < 0:
            errors[name] = labels
        elif told and len(np.unique(labels)) != told[0]:
            errors[name] = f"{len(np.unique(labels))} segments"
    return errors


def change_when_moved(method, *told):
    """For each example mesh how much labels change, as Rand Index error, when it is moved, turned and scaled."""
    turn = Rotation.from_euler("xyz", [20, 40, 60], degrees=True).as_matrix()
    return {
        name: rand_index_error(
            method(mesh.vertices, mesh.faces, *told), method(37.0 * mesh.vertices @ turn.T + 5, mesh.faces, *told)
        )
        for name, mesh in example_meshes().items()
    }


def change_when_renumbered(method, mesh, *told):
    """How much labels change, as Rand Index error, when vertices and faces are renumbered."""
    rng = np.random.default_rng(0)
    of_vertices, of_faces = rng.permutation(len(mesh.vertices)), rng.permutation(len(mesh.faces))
    faces = np.argsort(of_vertices)[mesh.faces[of_faces]]
    labels = method(mesh.vertices[of_vertices], faces, *told)
    return rand_index_error(method(mesh.vertices, mesh.faces, *told)[of_faces], labels)
