"""Quantisation: coordinates with few digits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._merging import merge_vertices
from perturb._normals import is_degenerate
from perturb.meshes import as_trimesh, size_exponent
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh

    from perturb.perturbation import Scalar


@dataclass(frozen=True)
class Quantisation(Perturbation):
    """Round all coordinates, as compressed and single-precision files do. Deterministic.

    Parameters
    ----------
    amount : float
        The number of bits that remain, a whole number from 1 to 53: the fewer, the coarser. 53, the precision of the
        coordinates themselves, is the identity.
    unit : str
        "bits": to the nearest point of a cubic grid with 2^amount points along the longest side of the bounding box, as
        formats for compressed meshes do. "significand_bits": to floating-point numbers with that many binary digits: 24
        is single precision, which binary STL files have, 11 half precision; coordinates far from the origin lose most.
    weld : bool
        Whether vertices that coincide after rounding are merged, and faces that thereby collapse removed. If not, the
        faces remain, and may have no area.

    Notes
    -----
    Grid points are equally spaced in all three directions. `Perturbed.applied` contains the number of vertices that
    moved, the largest displacement of a coordinate, in the mesh's own unit, and how many faces have no area or were
    removed. Merging can join parts that touch. Of vertices at one position the first remains, and is the
    counterpart of all of them: ``applied["counterpart_by"]`` is "position". The range of exponents is not limited.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> rounded = perturb.Quantisation(amount=4)(sphere, np.random.default_rng(0)).mesh
    >>> len(np.unique(rounded.vertices[:, 0]))
    16
    >>> single = perturb.Quantisation(amount=24, unit="significand_bits")(sphere, np.random.default_rng(0)).mesh
    >>> bool((single.vertices == sphere.vertices.astype(np.float32)).all())
    True
    """

    amount: float = 10
    unit: str = "bits"
    weld: bool = True

    name: ClassVar[str] = "quantisation"
    neutral: ClassVar[float] = 53.0
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("bits", "significand_bits")}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=self.neutral, positive=True, whole=True)
        if not isinstance(self.weld, bool):
            raise PerturbationError(f"quantisation: weld is {self.weld!r}; it must be true or false")

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        rounded = self._rounded(mesh)
        moved_by = np.abs(rounded - vertices)
        flat = is_degenerate(rounded, faces)
        if flat.all():
            raise PerturbationError(
                f"quantisation: with {self.amount:g} {self.unit} no face has an area any more, possibly because of a "
                "vertex far away, or of the whole mesh far from the origin; choose a larger amount, or move the mesh"
            )
        facts: dict[str, Scalar] = {
            "vertices_moved": int(np.count_nonzero(moved_by.any(axis=1))),
            "largest_rounding": float(moved_by.max()),
        }
        if not self.weld or self.amount == self.neutral:
            facts["faces_without_area"] = int(np.count_nonzero(flat))
            return self.finish(mesh, as_trimesh(rounded, faces), np.arange(len(vertices)), **facts)
        into = _first_at_same_position(rounded, faces)
        result, counterpart, n_collapsed = merge_vertices(rounded, faces, into)
        return self.finish(
            mesh,
            result,
            counterpart,
            **facts,
            vertices_merged=int(np.count_nonzero(into != np.arange(len(into)))),
            faces_collapsed=n_collapsed,
            counterpart_by="position",
        )

    def _rounded(self, mesh: trimesh.Trimesh) -> np.ndarray:
        """(n, 3) the rounded coordinates."""
        vertices = np.asarray(mesh.vertices)
        if self.amount == self.neutral:
            return vertices
        bits = int(self.amount)
        if self.unit == "significand_bits":
            significand, exponent = np.frexp(vertices)
            return np.ldexp(np.round(np.ldexp(significand, bits)), exponent - bits)
        scale = size_exponent(mesh)  # so that the spacing of the grid does not underflow
        low = np.ldexp(mesh.bounds[0], -scale)
        spacing = np.ldexp(mesh.extents.max(), -scale) / (2**bits - 1)
        return np.ldexp(low + spacing * np.round((np.ldexp(vertices, -scale) - low) / spacing), scale)


def _first_at_same_position(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(n,) for each vertex with faces the first one at its position; vertices without faces remain apart."""
    into = np.arange(len(vertices))
    used = np.unique(faces)
    _, first, position = np.unique(vertices[used], axis=0, return_index=True, return_inverse=True)
    into[used] = used[first[position.ravel()]]
    return into
