"""Perturbations of triangle meshes: noise, holes, short circuits, decimation, scaling, missing parts.

    perturbed = perturb.NormalNoise(amount=0.34, unit="mean_edge_length")(mesh, rng)

takes a `trimesh.Trimesh` and a `numpy.random.Generator`, leaves the mesh as it is, and gives a `Perturbed`.
"""

from perturb.geometry import MissingParts, Scaling
from perturb.noise import NormalNoise, ShotNoise
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed, get, names
from perturb.sampling import Decimation
from perturb.tessellation import Tessellation
from perturb.topology import Holes, ShortCircuits

__all__ = [
    "Decimation",
    "Holes",
    "MissingParts",
    "NormalNoise",
    "Parameters",
    "Perturbation",
    "PerturbationError",
    "Perturbed",
    "Scaling",
    "ShortCircuits",
    "ShotNoise",
    "Tessellation",
    "get",
    "names",
]
