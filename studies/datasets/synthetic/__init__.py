"""Shapes whose parts are known exactly, at any resolution and in several poses, without any download.

A shape is a skeleton of round limbs that melt into each other; its surface is extracted from their distances, and the
part of a face is the one that is nearest to it.
"""

from studies.datasets.synthetic.dataset import Synthetic, SyntheticModel

__all__ = ["Synthetic", "SyntheticModel"]
