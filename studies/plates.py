"""``python -m studies.plates [MESH …]``: the paper's figures as interactive plates, on one page.

Without meshes, those are shown that installed packages contain, and synthetic shapes. Of your own, the first is shown
wherever a figure has one mesh, and all of them where it has several.
"""

from __future__ import annotations

import argparse
import math
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies._own_packages import CONF
from studies.storage import default_results
from studies.storage.folders import PLATES_FILE
from studies.terminal import MISTAKE, SUCCESS, one_line, run_command

if TYPE_CHECKING:
    import numpy as np

    from studies.datasets import Dataset, Model
    from studies.figures.method_scenes import Shape
    from studies.figures.scenes import Scene
    from studies.reporting.html.plates_page import Plate

PLATES = CONF / "plates.yaml"
TITLE = "The paper's figures as interactive plates"
LEAD = (
    "Each corresponds to a figure of the paper that introduced the Heat Walk, on other meshes unless its own are given."
)
BYTES = 15e6  # of a page
FACES = 6000  # displayed of a mesh that is shown alone or beside a variant
FACES_IN_A_CROWD = 24000  # displayed of all meshes that are shown side by side
MOST_SHAPES = 20
UPRIGHT_TOSCA = 2
SYNTHETIC_SHAPES = ("biped", "hand", "octopus", "bird", "fish", "chair", "cup", "pliers", "star")  # of the showcase


@dataclass(frozen=True)
class Sources:
    """Where the meshes of the plates come from.

    Parameters
    ----------
    meshes, poses : sequence of Path
        of the user
    psb, tosca : Path, optional
        folders or archives of these datasets
    """

    meshes: Sequence[Path] = ()
    poses: Sequence[Path] = ()
    psb: Path | None = None
    tosca: Path | None = None
    _shapes: dict[Any, Shape] = field(default_factory=dict, compare=False)

    def one(self, plate: Mapping[str, Any]) -> Shape:
        """The mesh of a plate that shows one."""
        if self.meshes:
            return self._of_file(self.meshes[0], FACES)
        models = self._of_dataset(plate, "psb")
        return self._of_model(models[0] if models else _bundled()[plate["model"]], FACES)

    def several(self, plate: Mapping[str, Any]) -> list[Shape]:
        """The meshes of a plate that shows kinds of shapes, or shapes of one kind."""
        models = self._of_dataset(plate, "psb")
        if plate["shows"] == "showcase" and self.meshes:
            files = self.meshes[:MOST_SHAPES]
            return [self._of_file(file, FACES_IN_A_CROWD // len(files)) for file in files]
        if not models and plate["shows"] == "showcase":
            models = [*_bundled().values(), *_synthetic(SYNTHETIC_SHAPES)]
        if not models:
            models = [model for seed in plate["seeds"] for model in _synthetic(plate["models"], seed)]
        return [self._of_model(model, FACES_IN_A_CROWD // len(models)) for model in models]

    def posed(self, plate: Mapping[str, Any]) -> list[list[tuple[Shape, np.ndarray]]]:
        """The poses of a plate by shape, each with its vertices at the points that all of a shape have in common."""
        import numpy as np

        if self.poses:
            shapes = [self._of_file(path, FACES_IN_A_CROWD // len(self.poses)) for path in self.poses]
            counts = {len(shape.mesh.vertices) for shape in shapes}
            if len(counts) > 1:
                raise PlatesError(
                    "--poses: the meshes differ in the number of vertices; those of poses correspond by number"
                )
            return [[(shape, np.arange(len(shape.mesh.vertices))) for shape in shapes]]
        models = self._of_dataset(plate, "tosca") or _synthetic(plate["models"])
        by_shape: dict[str, list[tuple[Shape, np.ndarray]]] = {}
        for model in models:
            shape = self._of_model(model, FACES_IN_A_CROWD // len(models))
            by_shape.setdefault(model.category, []).append((shape, model.correspondence()))
        return list(by_shape.values())

    def _of_dataset(self, plate: Mapping[str, Any], name: str) -> list[Model]:
        """Those models of a plate that a dataset of the user has; some others if it has none of them."""
        root = {"psb": self.psb, "tosca": self.tosca}[name]
        if root is None or name not in plate:
            return []
        available = {model.name: model for model in _models(name, root)}
        wanted = [available[str(each)] for each in plate[name] if str(each) in available]
        if len(wanted) >= min(2, len(plate[name])):
            return wanted
        return list(available.values())[: len(plate[name])]

    def _of_model(self, model: Model, most_faces: int) -> Shape:
        upright = UPRIGHT_TOSCA if type(model).__name__ == "TOSCAModel" else 1
        seed = getattr(model, "seed", None)
        name = model.name if seed is None else f"{model.name} ({seed})"
        return self._shape((model, most_faces), name, model.load, upright, most_faces)

    def _of_file(self, path: Path, most_faces: int) -> Shape:
        from heatwalk.io import read_mesh

        return self._shape((path, most_faces), path.stem, lambda: read_mesh(path), 1, most_faces)

    def _shape(self, key: Any, name: str, load: Callable[[], Any], upright: int, most_faces: int) -> Shape:
        from studies.figures.method_scenes import Shape

        if key not in self._shapes:
            self._shapes[key] = Shape(name, load(), upright, most_faces)
        return self._shapes[key]


class PlatesError(ValueError):
    """What is wrong with the meshes that were given."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="studies.plates", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("meshes", nargs="*", type=Path, metavar="MESH", help="meshes of your own")
    parser.add_argument(
        "--poses", nargs="+", type=Path, default=(), metavar="MESH", help="poses of one shape, for Figure 6"
    )
    parser.add_argument(
        "--psb", type=Path, metavar="ROOT", help="the Princeton benchmark, whose models the paper shows"
    )
    parser.add_argument("--tosca", type=Path, metavar="ROOT", help="TOSCA, for Figure 6")
    parser.add_argument("--figures", type=_figures, metavar="1,3,6", help="only these figures (default: all)")
    parser.add_argument("--output", type=Path, metavar="PAGE.html", help="(default: plates.html where results are)")
    options = parser.parse_args(arguments)
    output = options.output or default_results() / PLATES_FILE

    from heatwalk.meshes import MeshError
    from heatwalk.spectrum import SpectrumError
    from perturb import PerturbationError
    from studies.datasets import DatasetError
    from studies.reporting.html.plates_page import plates_page

    sources = Sources(options.meshes, options.poses, options.psb, options.tosca)
    start = time.perf_counter()
    try:
        plates = list(make_plates(sources, options.figures, lambda plate: print(plate.name, flush=True)))
        page = plates_page(plates, TITLE, LEAD, _facts(plates, time.perf_counter() - start), _command(options))
        output.parent.mkdir(parents=True, exist_ok=True)
        page.write(output)
    except (MeshError, SpectrumError, PerturbationError, DatasetError, PlatesError, OSError) as error:
        print(f"studies.plates: error: {one_line(error)}", file=sys.stderr)
        return MISTAKE
    megabytes = output.stat().st_size / 1e6
    print(f"written: {output} ({megabytes:.1f} MB, {time.perf_counter() - start:.0f} s)")
    return SUCCESS


def make_plates(
    sources: Sources, figures: Sequence[int] | None = None, done: Callable[[Plate], None] = lambda plate: None
) -> Iterator[Plate]:
    """The plates of some figures, one after the other.

    Parameters
    ----------
    sources : Sources
    figures : sequence of int, optional
        numbers of the figures; all by default
    done : callable
        called with each plate

    Examples
    --------
    >>> [plate] = make_plates(Sources(), [3])
    >>> plate.name, plate.scenes[0].slider
    ('3. The steps of the walk', 'steps')
    """
    from studies.reporting.html.plates_page import Plate

    for each in _configured():
        if figures is None or each["figure"] in figures:
            scenes, shown = _scenes(each, sources)
            plate = Plate(each["figure"], each["title"], each["look"], shown, scenes)
            done(plate)
            yield plate


def _scenes(plate: Mapping[str, Any], sources: Sources) -> tuple[list[Scene], str]:
    """The scenes of a plate, and which meshes they show."""
    from studies.experiments.named_perturbations import perturbation_named
    from studies.figures import method_scenes

    shows = plate["shows"]
    if shows == "poses":
        groups = sources.posed(plate)
        scenes = method_scenes.pose_scenes(groups)
        return scenes, _listed([shape.name for group in groups for shape, _ in group])
    if shows in method_scenes.OF_SEVERAL:
        shapes = sources.several(plate)
        return method_scenes.OF_SEVERAL[shows](shapes), _listed([shape.name for shape in shapes])
    shape = sources.one(plate)
    if shows in method_scenes.OF_ONE:
        return method_scenes.OF_ONE[shows](shape), shape.name
    return method_scenes.perturbed_scenes(shape, perturbation_named(shows)), shape.name


def _listed(names: Sequence[str]) -> str:
    return ", ".join(dict.fromkeys(names))


def _configured() -> list[dict[str, Any]]:
    """The plates as the configuration describes them."""
    import yaml

    return list(yaml.safe_load(PLATES.read_text("utf-8")))


def _figures(text: str) -> list[int]:
    """The value of --figures."""
    numbers = [each["figure"] for each in _configured()]
    try:
        chosen = [int(each) for each in text.split(",")]
    except ValueError:
        chosen = []
    if not chosen or set(chosen) - set(numbers):
        raise argparse.ArgumentTypeError(
            f"must be numbers from {min(numbers)} to {max(numbers)}, such as 1,3, got {text!r}"
        )
    return chosen


def _bundled() -> dict[str, Model]:
    from studies.datasets.bundled import Bundled

    return {model.name: model for model in Bundled().models()}


def _synthetic(names: Sequence[str], seed: int | None = None) -> list[Model]:
    from studies.datasets.synthetic import Synthetic

    models = {model.name: model for model in Synthetic(models=list(names), seed=seed).models()}
    return [models[name] for name in names]


@cache
def _models(name: str, root: Path) -> Sequence[Model]:
    """The models of a dataset of the user."""
    from studies.datasets.psb import PSB
    from studies.datasets.tosca import TOSCA

    dataset: Dataset = PSB(root) if name == "psb" else TOSCA(root)
    return dataset.models()


def _facts(plates: Sequence[Plate], seconds: float) -> list[tuple[str, str]]:
    """What is shown, in words."""
    import heatwalk

    meshes = _listed([name for plate in plates for name in plate.shown.split(", ")])
    return [("meshes", meshes), ("made in", f"{math.ceil(seconds)} s"), ("version", f"heatwalk {heatwalk.__version__}")]


def _command(options: argparse.Namespace) -> str:
    """The command that makes the page again."""
    words = ["python", "-m", "studies.plates", *map(str, options.meshes)]
    for name in ("psb", "tosca", "output"):
        if getattr(options, name) is not None:
            words += [f"--{name}", getattr(options, name).as_posix()]
    if options.figures:
        words += ["--figures", ",".join(map(str, options.figures))]
    if options.poses:
        words += ["--poses", *map(str, options.poses)]
    return shlex.join(words)


if __name__ == "__main__":
    run_command(main)
