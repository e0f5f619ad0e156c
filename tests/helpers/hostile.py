"""Code under study that raises what ends a program instead of an error, and lets other trials alone."""

import sys
from dataclasses import dataclass

import numpy as np

import perturb
from studies.datasets import Dataset, Model
from studies.datasets.files import FileModel
from tests.helpers.meshes import bundled


class Farewell(BaseException):
    """An exception that is no `Exception`."""


class Unspeakable(Exception):
    """An error whose message raises."""

    def __str__(self):
        raise SystemExit(4)


DEEDS = {
    "exit0": (lambda: sys.exit(0), "SystemExit: 0"),
    "exit3": (lambda: sys.exit(3), "SystemExit: 3"),
    "exit": (lambda: sys.exit("usage: mytool"), "SystemExit: usage: mytool"),
    "interrupt": (lambda: _raise(KeyboardInterrupt()), "KeyboardInterrupt:"),
    "generator": (lambda: _raise(GeneratorExit("over")), "GeneratorExit: over"),
    "own": (lambda: _raise(Farewell("so\nlong")), "Farewell: so long"),
    "unspeakable": (lambda: _raise(Unspeakable()), "Unspeakable: (its message cannot be shown)"),
    "surrogate": (lambda: _raise(ValueError("K" + chr(0xDCFC) + "che")), "ValueError: K\\udcfcche"),
}


def _raise(error):
    raise error


def halves(vertices, faces, deed="exit0"):
    """Two segments, by x; for a mesh of twice the ant's size, a deed."""
    if round(np.ptp(vertices[:, 0]) / np.ptp(bundled("ant").vertices[:, 0])) == 2:
        DEEDS[deed][0]()
    return (vertices[:, 0] > np.median(vertices[:, 0])).astype(np.int64)


@dataclass(frozen=True)
class Leaving(perturb.Scaling):
    """Scaling, that leaves the program at a factor of 2."""

    def apply(self, mesh, parameters):
        if self.amount == 2:
            sys.exit(0)
        return self.finish(mesh, *perturb.moved(mesh, mesh.vertices * self.amount))


@dataclass(frozen=True)
class LeavingModel(FileModel):
    """A mesh in a file, that leaves the program instead of being read."""

    def load(self):
        sys.exit(0)


class Leavers(Dataset):
    """The ant, and a model that leaves the program."""

    name = "leavers"

    def models(self) -> list[Model]:
        from pathlib import Path

        path = Path("ant.off").absolute()
        return [LeavingModel("a", "", path), FileModel("b", "", path)]
