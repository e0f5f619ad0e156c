"""The dataset of synthetic shapes and its models."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.metadata import version
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from heatwalk.io import LoadedMesh
from studies.datasets.cache import cached_mesh
from studies.datasets.dataset import (
    Dataset,
    DatasetError,
    Model,
    listed_names,
    natural_order,
    require_available,
    selected_names,
)
from studies.datasets.synthetic.shapes import SHAPES
from studies.datasets.synthetic.skeleton import Shape
from studies.datasets.synthetic.surface import Surface, corresponding, labelled, make_mesh
from studies.reporting.text import count_of

VERSION = 1  # raise it when a change of the code alters meshes, labels or corresponding points

DEFAULT_RESOLUTION = 6000
FEWEST_VERTICES, MOST_VERTICES = 1_000, 500_000

_PACKAGES = ("numpy", "scipy", "scikit-image")  # that compute the surfaces


@dataclass(frozen=True)
class SyntheticModel(Model):
    """A pose of a shape; the shape is its category.

    The first `load` takes one or two seconds at 6,000 vertices; the mesh is then kept on disk.

    Parameters
    ----------
    pose : int
        1 for the rest pose
    resolution : int
        about how many vertices
    seed : int or None
        of what varies, see `Synthetic`
    """

    pose: int
    resolution: int
    seed: int | None

    ground_truth: ClassVar[bool] = True

    @property
    def parts(self) -> tuple[str, ...]:
        """The names of the parts, in the order of their labels."""
        return SHAPES[self.category].parts

    def load(self) -> LoadedMesh:
        """The mesh."""
        surface = self.surface()
        note = f"generated with {count_of(len(self.parts), 'part')}: {', '.join(self.parts)}"
        return LoadedMesh(surface.vertices.copy(), surface.faces.copy(), (note,))

    def digest(self) -> str:
        """SHA-256 of the shape, the pose, the resolution, and the versions of the code and packages that compute it."""
        what = (VERSION, self.shape(), self.pose, self.resolution, [version(package) for package in _PACKAGES])
        return hashlib.sha256(repr(what).encode()).hexdigest()

    def human_segmentations(self) -> list[NDArray[np.int64]]:
        """The exact segmentation, as if one person had made it.

        Returns
        -------
        list of (m,) int64 array
            one array, with the index in `parts` of the part that is nearest to each face
        """
        return [self.surface().labels.copy()]

    def human_digest(self) -> str:
        """The digest of the mesh, which determines the labels too."""
        return self.digest()

    def correspondence(self) -> NDArray[np.int64]:
        """The vertices of this pose at the points where the skeleton carries the vertices of the rest pose.

        Returns
        -------
        (p,) int64 array
            for each vertex of the rest pose of the same resolution and seed the nearest one of this pose; all
            vertices, in order, for the rest pose itself
        """
        if self.pose == 1:
            return np.arange(len(self.surface().vertices))
        return _corresponding(self, self.correspondence_digest()).copy()

    def correspondence_digest(self) -> str:
        """SHA-256 of the digests of this pose and of the rest pose."""
        return hashlib.sha256(f"{self.digest()} {self.rest().digest()}".encode()).hexdigest()

    def shape(self) -> Shape:
        """The shape with its proportions."""
        return SHAPES[self.category].varied(self.seed)

    def rest(self) -> SyntheticModel:
        """The rest pose of the same shape."""
        return replace(self, name=self.category, pose=1)

    def surface(self) -> Surface:
        """The mesh with its labels, shared: not to be modified."""
        return _surface(self, self.digest())


class Synthetic(Dataset):
    """Twelve shapes: a biped, a quadruped, a hand, an octopus, a bird, a fish, a chair, a cup, pliers, a tree, a star
    and a snake, each in a rest pose and in another one.

    Meshes are closed, of one component, with the shape's number of handles, and of triangles with good angles; the
    same options give the same bytes in every process on one machine. Each shape is a category.

    Parameters
    ----------
    models : sequence of str, optional
        names such as ``hand``, the rest pose, or ``hand-2``, its second pose; all by default
    poses : sequence of int, optional
        numbers of poses, 1 being the rest pose; all by default. With ``models``: those that satisfy both
    resolution : int
        about how many vertices a model has, from 1,000
    seed : int, optional
        varies the proportions: limbs become up to 8 % longer or shorter, and thicker or thinner, and the axes of a
        shape are stretched by up to 5 %. Another number gives other individuals; by default none is varied.

    Examples
    --------
    >>> [model.name for model in Synthetic(models=["hand", "cup-2", "cup"]).models()]
    ['hand', 'cup', 'cup-2']
    >>> [model] = Synthetic(models=["cup"], resolution=1000).models()
    >>> model.parts
    ('bowl', 'handle')
    """

    name = "synthetic"

    def __init__(
        self,
        models: Sequence[str] | None = None,
        poses: Sequence[int] | None = None,
        resolution: int = DEFAULT_RESOLUTION,
        seed: int | None = None,
    ):
        self._names = selected_names("models", models)
        self._poses = selected_names("poses", poses)
        _check_whole_number("resolution", resolution, FEWEST_VERTICES, MOST_VERTICES)
        if seed is not None:
            _check_whole_number("seed", seed, 0, 2**32 - 1)
        self._resolution, self._seed = resolution, seed

    def models(self) -> list[Model]:
        """The models, shape by shape, in the order of their poses.

        Returns
        -------
        list of SyntheticModel

        Raises
        ------
        DatasetError
            If there is no model or pose that was asked for, or if the two options together leave no model.
        """
        available = {
            f"{name}-{pose}" if pose > 1 else name: (name, pose)
            for name, shape in SHAPES.items()
            for pose in range(1, len(shape.poses) + 2)
        }
        numbers = sorted({str(pose) for _, pose in available.values()}, key=natural_order)
        root = "the dataset synthetic"
        if self._names is not None:
            require_available("models", self._names, set(available), listed_names(list(available)), root)
        if self._poses is not None:
            require_available("poses", self._poses, set(numbers), ", ".join(numbers), root)
        models: list[Model] = [
            SyntheticModel(name, shape, pose, self._resolution, self._seed)
            for name, (shape, pose) in available.items()
            if (self._names is None or name in self._names) and (self._poses is None or str(pose) in self._poses)
        ]
        if not models:
            raise DatasetError("dataset.models and dataset.poses together select none of the synthetic models")
        return models

    def total(self) -> int:
        """How many models there are in all poses."""
        return sum(len(shape.poses) + 1 for shape in SHAPES.values())


def _check_whole_number(option: str, value: int, least: int, most: int) -> None:
    """Raise DatasetError unless the value of an option is a whole number in a range."""
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise DatasetError(f"dataset.{option}={value} must be a whole number from {least:,} to {most:,}")


@lru_cache(maxsize=64)
def _surface(model: SyntheticModel, digest: str) -> Surface:
    """The surface of a model, computed or read once per process."""

    def compute() -> LoadedMesh:
        return LoadedMesh(*make_mesh(model.shape(), model.pose, model.resolution), ())

    mesh = cached_mesh(digest, compute)
    return labelled(model.shape(), model.pose, mesh.vertices, mesh.faces)


@lru_cache(maxsize=64)
def _corresponding(model: SyntheticModel, digest: str) -> NDArray[np.int64]:
    """The corresponding vertices of a pose, computed once per process."""
    return corresponding(model.shape(), model.pose, model.rest().surface(), model.surface())
