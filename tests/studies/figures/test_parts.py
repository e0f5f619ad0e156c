"""Shapes with limbs whose parts are known: a part has the same number in each."""

import numpy as np
import pytest
import trimesh

import perturb
from studies.figures.parts import describe_parts, match_parts
from studies.figures.views import view_of


def star(lengths, turn=0.0):
    """A disk with a wedge for each limb, as long as it says: its mesh, the limb of each vertex, and the tips."""
    sphere = trimesh.creation.icosphere(4)
    direction, faces = np.asarray(sphere.vertices), sphere.faces
    angle = (np.arctan2(direction[:, 1], direction[:, 0]) + turn) % (2 * np.pi)
    limb = (angle / (2 * np.pi) * len(lengths)).astype(int) % len(lengths)
    within = angle / (2 * np.pi) * len(lengths) % 1
    reach = np.sin(np.pi * within) ** 4 * np.cos(np.arcsin(np.clip(direction[:, 2], -1, 1))) ** 4
    grown = direction * (1 + np.array(lengths)[limb] * reach)[:, None]
    mesh = perturb.as_trimesh(grown, faces)
    tips = np.array([np.where(limb == i, np.linalg.norm(grown, axis=1), 0).argmax() for i in range(len(lengths))])
    return mesh, limb, tips


def described(mesh, labels, tips):
    return describe_parts(mesh, labels, tips, view_of(np.asarray(mesh.vertices)))


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 1, 0, 2], [2, 3, 1, 0]])
def test_limbs_are_recognised_by_their_lengths_whatever_their_numbers_and_the_size_of_the_shape(order):
    mesh, labels, tips = star([1.0, 2.0, 3.5, 5.0])
    other = mesh.copy().apply_scale(7.0)
    numbers = np.argsort(order)  # limb i has the number numbers[i] in the other shape
    matched = match_parts(described(mesh, labels, tips), described(other, numbers[labels], tips[order]))
    assert matched.tolist() == order


def test_a_part_without_a_counterpart_has_a_new_number():
    mesh, labels, tips = star([1.0, 2.0, 3.5, 5.0])
    reference, more = described(mesh, labels, tips), described(mesh, labels, tips)
    two = describe_parts(mesh, np.where(labels < 2, labels, -1), tips[:2], view_of(np.asarray(mesh.vertices)))
    assert sorted(match_parts(two, more).tolist()) == [0, 1, 2, 3]
    assert len(set(match_parts(reference, two).tolist())) == 2
