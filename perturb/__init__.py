"""Perturbations of triangle meshes: of their geometry, their topology and their triangles, by scanners and by files.

Notes
-----
Each perturbation is one module of this package, ``perturb/<name>.py``. The modules are found when they are first
needed: adding a file is enough for ``perturb.names()`` to list the perturbation and for ``perturb.<Class>`` to be the
class. Modules whose name starts with an underscore, and `perturb.testing`, are not searched.

Examples
--------
>>> import numpy as np
>>> import perturb
>>> import trimesh
>>> sphere = trimesh.creation.icosphere()
>>> perturbed = perturb.Holes(amount=58)(sphere, np.random.default_rng(1))
>>> len(sphere.faces) - len(perturbed.mesh.faces)
58
>>> "holes" in perturb.names()
True
"""

from typing import TYPE_CHECKING

from perturb.meshes import (
    LENGTHS,
    as_trimesh,
    edge_graph,
    moved,
    random_direction,
    vertex_normals,
    without_faces,
)
from perturb.perturbation import (
    Parameters,
    Perturbation,
    PerturbationError,
    Perturbed,
    get,
    names,
)
from perturb.perturbation import shipped_classes as _shipped_classes

if TYPE_CHECKING:
    from perturb.affine import Affine
    from perturb.bending import Bending
    from perturb.composite import Composite
    from perturb.decimation import Decimation
    from perturb.duplicates import Duplicates
    from perturb.flipped import Flipped
    from perturb.floaters import Floaters
    from perturb.holes import Holes
    from perturb.local_scale import LocalScale
    from perturb.micro_holes import MicroHoles
    from perturb.missing_parts import MissingParts
    from perturb.normal_noise import NormalNoise
    from perturb.quantisation import Quantisation
    from perturb.rasterisation import Rasterisation
    from perturb.renumbering import Renumbering
    from perturb.rotation import Rotation
    from perturb.sampling import Sampling
    from perturb.scaling import Scaling
    from perturb.self_intersections import SelfIntersections
    from perturb.short_circuits import ShortCircuits
    from perturb.shot_noise import ShotNoise
    from perturb.slivers import Slivers
    from perturb.smoothing import Smoothing
    from perturb.tessellation import Tessellation
    from perturb.translation import Translation
    from perturb.unwelded import Unwelded
    from perturb.view import View
    from perturb.welding import Welding

__all__ = [
    "LENGTHS",
    "Affine",
    "Bending",
    "Composite",
    "Decimation",
    "Duplicates",
    "Flipped",
    "Floaters",
    "Holes",
    "LocalScale",
    "MicroHoles",
    "MissingParts",
    "NormalNoise",
    "Parameters",
    "Perturbation",
    "PerturbationError",
    "Perturbed",
    "Quantisation",
    "Rasterisation",
    "Renumbering",
    "Rotation",
    "Sampling",
    "Scaling",
    "SelfIntersections",
    "ShortCircuits",
    "ShotNoise",
    "Slivers",
    "Smoothing",
    "Tessellation",
    "Translation",
    "Unwelded",
    "View",
    "Welding",
    "as_trimesh",
    "edge_graph",
    "get",
    "moved",
    "names",
    "random_direction",
    "vertex_normals",
    "without_faces",
]


def __getattr__(name: str) -> type[Perturbation]:
    """Return the perturbation class of that name from the modules of this package."""
    # Python and its tools ask every module for names such as __wrapped__; no class is called that.
    if not name.startswith("_") and name in (classes := _shipped_classes()):
        globals()[name] = classes[name]
        return classes[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_shipped_classes()})
