"""Renumbering of vertices and faces: a control that no method should notice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb.meshes import as_trimesh
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Renumbering(Perturbation):
    """Give vertices and faces other numbers, and let faces start at another corner; the surface remains the same.

    Parameters
    ----------
    amount : float
        The share of the vertices, and that of the faces, 0 to 1; ``round(amount * n)`` of each.
    unit : str
        "share_of_vertices_and_faces".

    Notes
    -----
    The chosen vertices exchange their numbers along a random cycle, so that each gets another one, and so do the chosen
    faces. The corners of these faces are rotated by one or two places, which keeps the winding.

    A control: no coordinate changes. A method that breaks ties by the number of a vertex can return other labels on a
    shape with exact symmetries, and one that adds numbers up in the order of the faces rounds differently.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> renumbered = perturb.Renumbering(amount=0.5)(sphere, np.random.default_rng(0))
    >>> bool((renumbered.mesh.vertices[renumbered.counterpart] == sphere.vertices).all())
    True
    >>> int((renumbered.counterpart != np.arange(642)).sum())
    321
    """

    amount: float = 1.0
    unit: str = "share_of_vertices_and_faces"

    name: ClassVar[str] = "renumbering"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("share_of_vertices_and_faces",)}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=1)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `vertices` (k,) and `faces` (l,), cycles of numbers, and `turns` (l,), places by which corners turn."""
        counts = [round(self.amount * n) for n in (len(mesh.vertices), len(mesh.faces))]
        if self.amount > 0 and max(counts) < 2:
            raise PerturbationError(
                f"renumbering: {self.amount:g} of {len(mesh.vertices)} vertices and of {len(mesh.faces)} faces are "
                "fewer than two of each, which cannot exchange their numbers; choose a larger amount"
            )
        vertices, faces = (
            rng.choice(n, count, replace=False)
            for n, count in zip((len(mesh.vertices), len(mesh.faces)), counts, strict=True)
        )
        return {"vertices": vertices, "faces": faces, "turns": rng.integers(1, 3, len(faces))}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        number = _along_cycle(parameters["vertices"], len(mesh.vertices))
        face_number = _along_cycle(parameters["faces"], len(mesh.faces))
        corners = np.arange(3) + np.zeros((len(mesh.faces), 1), dtype=np.int64)
        corners[parameters["faces"]] += parameters["turns"][:, None]
        turned = np.take_along_axis(number[np.asarray(mesh.faces)], corners % 3, axis=1)
        vertices, faces = np.empty_like(mesh.vertices), np.empty_like(turned)
        vertices[number], faces[face_number] = mesh.vertices, turned
        return self.finish(
            mesh,
            as_trimesh(vertices, faces),
            number,
            vertices_renumbered=int(np.count_nonzero(number != np.arange(len(number)))),
            faces_renumbered=int(np.count_nonzero(face_number != np.arange(len(face_number)))),
            faces_turned=len(parameters["faces"]),
        )


def _along_cycle(cycle: np.ndarray, count: int) -> np.ndarray:
    """(count,) the new number of each item: that of the next in the cycle, or its own."""
    number = np.arange(count)
    number[cycle] = np.roll(cycle, -1)
    return number
