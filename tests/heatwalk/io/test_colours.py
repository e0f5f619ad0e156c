import numpy as np

from heatwalk.io import label_colours


def test_each_label_has_its_own_colour_whatever_the_other_labels_are():
    colours = label_colours(np.arange(60))
    assert len(np.unique(colours, axis=0)) == 60
    assert np.array_equal(label_colours(np.array([7, 3, 7])), colours[[7, 3, 7]])
    assert (colours[:, 3] == 255).all()


def test_only_the_dissipator_region_is_grey():
    colours = label_colours(np.arange(61), dissipator=20)
    is_grey = (colours[:, :3] == colours[:, :1]).all(axis=1)
    assert np.flatnonzero(is_grey).tolist() == [20]


def test_the_first_twenty_colours_are_distinct_from_each_other_and_from_grey():
    colours = np.vstack([label_colours(np.arange(20)), label_colours(np.array([0]), dissipator=0)])[:, :3] / 255.0
    linear = np.where(colours > 0.04045, ((colours + 0.055) / 1.055) ** 2.4, colours / 12.92)
    xyz = linear @ np.array([[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]])
    f = np.cbrt(xyz / [0.9505, 1.0, 1.089])  # every colour but the darkest lies in the cubic part of CIE L*a*b*
    lab = np.column_stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])])
    distance = np.linalg.norm(lab[:, None] - lab[None], axis=2)
    assert distance[np.triu_indices(len(lab), 1)].min() > 15  # about 2.3 is just noticeable
