"""The picture of all synthetic shapes in the documentation."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import cast

import numpy as np
import trimesh

from studies.datasets.synthetic.dataset import DEFAULT_RESOLUTION, Synthetic, SyntheticModel
from studies.datasets.synthetic.surface import field_of
from studies.figures.drawing import save
from studies.figures.layout import lay_out
from studies.figures.pictures import Row, Tile
from studies.figures.surfaces import surface
from studies.figures.views import View, view_along
from studies.planning.fingerprint import digest

COLUMNS = 6
TILE = (640, 560)

# Where the camera is, in degrees: to the right of the front, and above the ground.
VIEWS = {
    "biped": (22, 8), "quadruped": (62, 12), "hand": (14, 8), "octopus": (24, 36), "bird": (34, 34), "fish": (56, 24),
    "chair": (32, 18), "cup": (18, 26), "pliers": (180, 62), "tree": (10, 8), "star": (0, 56), "snake": (64, 34),
}  # fmt: skip


def draw(path: Path, resolution: int) -> None:
    """Draw every shape with its parts, in all poses.

    Parameters
    ----------
    path : Path
        PNG file to write
    resolution : int
        about how many vertices a shape has
    """
    models = Synthetic(resolution=resolution).models()
    tiles = [_tile(cast(SyntheticModel, model)) for model in models]
    rows = [Row(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
    subtitle = "every shape in its rest pose and in another one; a colour is a part, known exactly"
    content = digest(*(model.digest() for model in models))
    save(lay_out(rows, "The synthetic shapes", subtitle), path, content)


def _tile(model: SyntheticModel) -> Tile:
    mesh = model.load()
    shape = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    labels = field_of(model.shape(), model.pose).labels(mesh.vertices)
    return Tile(surface(shape, _view(model.category, mesh.vertices), labels=labels, size=TILE), model.name)


def _view(shape: str, vertices: np.ndarray) -> View:
    """The view of a shape from the side that shows it best."""
    around, above = np.radians(VIEWS[shape])
    towards = np.array([np.sin(around) * np.cos(above), np.sin(above), np.cos(around) * np.cos(above)])
    right = np.array([np.cos(around), 0.0, -np.sin(around)])
    return view_along(vertices, np.array([right, np.cross(towards, right), towards]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m studies.datasets.synthetic.picture", description=__doc__)
    parser.add_argument("file", type=Path, help="PNG file to write")
    parser.add_argument(
        "--resolution", type=int, default=DEFAULT_RESOLUTION, help="about how many vertices a shape has"
    )
    arguments = parser.parse_args()
    draw(arguments.file, arguments.resolution)
