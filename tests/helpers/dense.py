"""The method as printed in the paper, with n x n arrays: the reference for the tests."""

import numpy as np
import scipy.linalg


def cotangent_operator(vertices, faces):
    """Stiffness from the angles, triangle by triangle, and barycentric mass; both (n, n)."""
    n = len(vertices)
    stiffness, mass = np.zeros((n, n)), np.zeros((n, n))
    for face in faces:
        for turn in range(3):
            i, j, k = np.roll(face, turn)
            u, v = vertices[i] - vertices[k], vertices[j] - vertices[k]
            cotangent = u @ v / np.linalg.norm(np.cross(u, v))
            stiffness[i, i] += cotangent / 2
            stiffness[j, j] += cotangent / 2
            stiffness[i, j] -= cotangent / 2
            stiffness[j, i] -= cotangent / 2
            mass[k, k] += np.linalg.norm(np.cross(u, v)) / 6
    return stiffness, mass


def heat_kernel(vertices, faces, time):
    """h_t, (n, n), from every eigenpair, at standard time ``time`` on the mesh scaled to area 1."""
    _, mass = cotangent_operator(vertices, faces)
    stiffness, mass = cotangent_operator(vertices / np.sqrt(mass.sum()), faces)
    eigenvalues, eigenvectors = scipy.linalg.eigh(stiffness, mass)
    return (eigenvectors * np.exp(-eigenvalues * time)) @ eigenvectors.T


def algorithm_1(kernel, tie=1e-10):
    """Exemplar of every vertex after each step, with plain loops: a list of (n,) arrays."""
    n = len(kernel)
    exemplar = np.arange(n)
    potential = np.diag(kernel).copy()
    remaining = np.arange(n)
    history = [exemplar.copy()]
    while True:
        chosen, updated = {}, potential.copy()
        for x in remaining:
            capacity = np.minimum(kernel[x, remaining], potential[remaining])
            best = capacity.max()
            chosen[x] = remaining[np.flatnonzero(capacity >= best * (1 - tie))[0]]
            updated[x] = best
        potential = updated
        exemplar = np.array([chosen[e] for e in exemplar])
        left = np.unique(list(chosen.values()))
        if np.array_equal(left, remaining):
            return history
        remaining = left
        history.append(exemplar.copy())


def algorithm_2(kernel, labels, component):
    """Both divergences of every vertex: from the mean density of its cluster and from the uniform one."""
    n = len(kernel)
    size = np.bincount(component)[component]
    heat = np.maximum(kernel, 1e-300)
    density = heat / heat.sum(axis=1, keepdims=True)
    from_cluster, from_uniform = np.empty(n), np.empty(n)
    for x in range(n):
        cluster = heat[labels == labels[x]]
        mean = cluster.sum(axis=0) / cluster.sum()
        from_cluster[x] = np.sum(density[x] * np.log(density[x] / mean))
        from_uniform[x] = np.sum(density[x] * np.log(density[x] * size[x]))
    return from_cluster, from_uniform


def whole(kernel):
    """The n x n kernel of a ``HeatKernel``, assembled from the blocks of its components."""
    result = np.zeros((len(kernel.factor),) * 2)
    for part in kernel.parts():
        for rows, block in kernel.row_blocks(part):
            result[np.ix_(part[rows], part)] = block
    return result
