"""Twelve shapes of different kinds, proportioned by hand: about 2 in size, y up, facing z, their left at positive x."""

from studies.datasets.synthetic.shapes.animals import bird, fish, octopus, quadruped, snake, star
from studies.datasets.synthetic.shapes.body import biped, hand
from studies.datasets.synthetic.shapes.objects import chair, cup, pliers, tree

SHAPES = {
    shape.name: shape
    for shape in (
        biped(), quadruped(), hand(), octopus(), bird(), fish(), chair(), cup(), pliers(), tree(), star(), snake(),
    )
}  # fmt: skip
