"""``heatwalk view MESH``: a page on which a mesh, its segments and a variant can be looked at in a browser.

The command of `heatwalk` finds this one by an entry point, so that `heatwalk` imports nothing from here. Libraries are
imported by the functions that need them: ``heatwalk --help`` should not wait for them.
"""

from __future__ import annotations

import argparse
import math
import shlex
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatwalk.cli import add_weld, announce_compilation, fail, positive_time, print_mesh, read

if TYPE_CHECKING:
    import numpy as np

    import perturb
    from heatwalk.io import LoadedMesh
    from studies.figures.time_scenes import Side

METHOD, ROBUST_METHOD = "Heat Walk", "robust variant"
SUFFIXES = (".html", ".htm")

_EXAMPLE = """\
examples:
  heatwalk view cow.obj
  heatwalk view cow.obj --perturbation shot_noise --amount 0.2 --output page.html
  heatwalk view scan.ply --robust
  heatwalk view --perturbation help
"""


def add_command(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to those of ``heatwalk``.

    Examples
    --------
    >>> commands = argparse.ArgumentParser().add_subparsers()
    >>> add_command(commands)
    >>> list(commands.choices)
    ['view']
    """
    command = commands.add_parser(
        "view",
        help="show the mesh, its segments over time and a perturbed variant in the browser",
        description="Show a mesh in the browser: its segments at twenty times around --time (fewer if it is large),\n"
        "the functions that lead to them, and beside it a perturbed variant, or the segments of the robust variant\n"
        "of the method.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("mesh", type=Path, metavar="MESH", help="a mesh file")
    add_weld(command)
    command.add_argument(
        "--time", type=positive_time, default=1.0, metavar="T", help="the time that is shown first (default: 1)"
    )
    command.add_argument("--robust", action="store_true", help="also the segments of the robust variant of the method")
    command.add_argument(
        "--perturbation",
        action=_Perturbation,
        metavar="NAME",
        help="show a variant beside the original: a perturbation or a study of one, such as shot_noise; help lists all",
    )
    command.add_argument(
        "--amount",
        type=_number,
        metavar="A",
        help="of the perturbation, in the unit of its study (default: the level in the middle of the study)",
    )
    command.add_argument("--seed", type=_seed, default=0, metavar="N", help="of the perturbation (default: 0)")
    command.add_argument("--output", type=_page, metavar="PAGE.html", help="write the page instead of showing it")
    command.add_argument("--force", action="store_true", help="overwrite a file that this command did not write")
    command.set_defaults(run=_view)


class _Perturbation(argparse.Action):
    """The name of a perturbation; ``help`` prints all of them and exits, as ``--help`` does."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: str | None = None
    ) -> None:
        if values == "help":
            _print_perturbations()
            parser.exit()
        setattr(namespace, self.dest, values)


def _print_perturbations() -> None:
    """Print the perturbations, their units, and the levels of their studies."""
    from studies.experiments.named_perturbations import named_perturbations

    known = named_perturbations()
    width = max(map(len, known))
    print(f"{'--perturbation':<{width}}  --amount: what it is, and the levels of the study")
    for name, each in known.items():
        print(f"{name:<{width}}  {each.unit}: {', '.join(f'{level:g}' for level in each.levels)}")


def _number(text: str) -> float:
    """The value of --amount."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"must be a finite number, got {text!r}")
    return number


def _seed(text: str) -> int:
    """The value of --seed."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be a whole number of at least 0, got {text!r}")
    return int(text)


def _page(text: str) -> Path:
    """The value of --output."""
    if Path(text).suffix.lower() not in SUFFIXES:
        raise argparse.ArgumentTypeError(f"must end in .html, got {text!r}")
    return Path(text)


def _view(arguments: argparse.Namespace) -> int:
    """``heatwalk view``; returns the exit code."""
    from heatwalk.meshes import MeshError
    from heatwalk.numerics.compilation import announced
    from heatwalk.spectrum import SpectrumError
    from perturb import PerturbationError
    from studies.planning.errors import StudyError

    if arguments.amount is not None and arguments.perturbation is None:
        return fail("--amount needs --perturbation NAME; --perturbation help lists the names")
    problem = None if arguments.output is None else _problem_with_output(arguments.output, arguments.force)
    if problem is not None:
        return fail(problem)
    try:
        perturbation = _perturbation(arguments)
    except StudyError as error:
        return fail(error)
    mesh = read(arguments, arguments.mesh)
    if mesh is None:
        return 2
    print_mesh(arguments.mesh, mesh)
    try:
        with announced(announce_compilation):
            return _show(arguments, mesh, perturbation)
    except (MeshError, SpectrumError, PerturbationError) as error:
        return fail(f"{arguments.mesh}: {error}")
    except MemoryError:
        return fail(f"{arguments.mesh}: there is not enough memory to segment it")


def _problem_with_output(path: Path, force: bool) -> str | None:
    """Why a page cannot be written to a file; None if it can."""
    from studies.reporting.html.page import stored_scenes

    if not path.parent.is_dir():
        return f"{path}: cannot be written: no such directory"
    if path.is_dir():
        return f"{path}: cannot be written: it is a directory"
    if path.exists() and not force and stored_scenes(path) is None:
        return f"{path}: exists, and this command did not write it; choose another --output, or overwrite it by --force"
    return None


def _perturbation(arguments: argparse.Namespace) -> perturb.Perturbation | None:
    """The perturbation that the arguments name, at their amount or its own default, which they then have."""
    if arguments.perturbation is None:
        return None
    from studies.experiments.named_perturbations import perturbation_named

    named = perturbation_named(arguments.perturbation)
    if arguments.amount is None:
        arguments.amount = named.default
    arguments.unit = named.unit
    whole = float(arguments.amount).is_integer()
    return named.at(int(arguments.amount) if whole else arguments.amount)


def _show(arguments: argparse.Namespace, mesh: LoadedMesh, perturbation: perturb.Perturbation | None) -> int:
    """Make the page, and write or open it; returns the exit code."""
    from studies.figures.time_scenes import sides_of, times_around
    from studies.reporting.html.mesh_page import mesh_page
    from studies.reporting.text import count_of

    times = times_around(arguments.time, len(mesh.vertices))
    first = times.index(arguments.time)

    def announce(side: Side) -> None:
        name = ", ".join(filter(None, (side.title, side.row)))
        counts = [each.n_segments for each in side.at_times]
        print(f"{name}: {count_of(counts[first], 'segment')} at time {arguments.time:g}", end="")
        several = f" ({min(counts)} to {max(counts)} at times {times[0]:g} to {times[-1]:g})"
        print(several if len(times) > 1 else "", flush=True)

    methods = {METHOD: False, **({ROBUST_METHOD: True} if arguments.robust else {})}
    variant = None if perturbation is None else _variant(mesh, perturbation, arguments.seed)
    sides = sides_of((mesh.vertices, mesh.faces), variant, times, methods, announce)
    title = arguments.mesh.name if perturbation is None else f"{arguments.mesh.name}, {_label(arguments)}"
    page = mesh_page(title, times, sides, _facts(arguments, mesh, variant), _command(arguments), first)
    path = arguments.output
    try:
        if path is None:
            path = Path(tempfile.mkdtemp(prefix="heatwalk-")) / "view.html"
        page.write(path)
    except OSError as error:
        return fail(f"{path}: cannot be written: {error.strerror or error}")
    if arguments.output is not None:
        print(f"written: {path}")
    elif _open(path):
        print(f"opened: {path}")
    else:
        print(f"no browser can be opened here; the page is {path}")
    return 0


def _variant(
    mesh: LoadedMesh, perturbation: perturb.Perturbation, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices and faces of the perturbed mesh, and the counterparts of the original's vertices."""
    import numpy as np

    import perturb

    made = perturbation(perturb.as_trimesh(mesh.vertices, mesh.faces), np.random.default_rng(seed))
    return np.asarray(made.mesh.vertices), np.asarray(made.mesh.faces), made.counterpart


def _label(arguments: argparse.Namespace) -> str:
    return f"{arguments.perturbation.replace('_', ' ')} {arguments.amount:g}"


def _facts(
    arguments: argparse.Namespace, mesh: LoadedMesh, variant: Sequence[np.ndarray] | None
) -> list[tuple[str, str]]:
    """What is shown, in words."""
    import heatwalk

    facts = [("mesh", f"{arguments.mesh.name}: {len(mesh.vertices):,} vertices, {len(mesh.faces):,} faces")]
    facts += [("note on reading it", note) for note in mesh.notes]
    if variant is not None:
        facts += [
            ("perturbation", f"{_label(arguments)} ({arguments.unit}), seed {arguments.seed}"),
            ("variant", f"{len(variant[0]):,} vertices, {len(variant[1]):,} faces"),
        ]
    return [*facts, ("version", f"heatwalk {heatwalk.__version__}")]


def _command(arguments: argparse.Namespace) -> str:
    """The command that makes the page again."""
    words = ["heatwalk", "view", arguments.mesh.name]
    if arguments.weld is not None:
        words += ["--weld", str(arguments.weld)]
    if arguments.time != 1:
        words += ["--time", f"{arguments.time:g}"]
    if arguments.robust:
        words.append("--robust")
    if arguments.perturbation is not None:
        words += ["--perturbation", arguments.perturbation, "--amount", f"{arguments.amount:g}"]
        words += ["--seed", str(arguments.seed)]
    return shlex.join(words)


def _open(path: Path) -> bool:
    """Open a page in the browser; returns whether that was possible."""
    import webbrowser

    try:
        return webbrowser.open(path.resolve().as_uri())
    except (webbrowser.Error, OSError):
        return False
