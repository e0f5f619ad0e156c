"""The command ``heatwalk``: segment mesh files, or report on them."""

import argparse
import contextlib
import hashlib
import io
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from heatwalk import __version__

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from heatwalk.io import LoadedMesh
    from heatwalk.robust.segmentation import RobustSegmentation
    from heatwalk.segmentation import Segmentation

# SciPy and numba are imported by the commands that use them: `heatwalk --help` should not wait for them.

_EXAMPLE = """\
example:
  heatwalk example cow
  heatwalk inspect cow.obj
  heatwalk segment cow.obj --time 1 --output cow_segments.ply

mesh files: OFF, OBJ, PLY, STL, glTF (.glb, .gltf), 3MF, VTK (.vtk, .vtp, .vtu) or Gmsh (.msh), and compressed ones
(.gz, .bz2, .xz)
"""

# Entry points of this group add commands: each is a function of what `argparse`'s `add_subparsers` returned. They are
# looked for only where no command of this module is typed, since that takes longer than all else before a mesh is read.
_ADDED = "heatwalk.commands"

_INSTALL_AGAIN = "an installation that is older than a command has to be repeated to have it, as by pip install -e ."

# Rows of the table of segments, the largest first: symmetric shapes can have hundreds.
_MAX_ROWS = 20

# The margins of the walk are written if they take at most so many multiplications, about ten seconds.
_MOST_PRODUCTS = 5e10


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    argv : list of str, optional
        the arguments; by default those of the process

    Returns
    -------
    int
        0 on success; 2 if the mesh cannot be segmented or a file cannot be read or written, with a one-line reason on
        stderr

    Raises
    ------
    SystemExit
        by argparse, for --help, --version and invalid arguments

    Examples
    --------
    >>> main(["--version"])
    Traceback (most recent call last):
    SystemExit: 0
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")  # the terminal may lack "…", or letters of a file's name
    try:
        try:
            return _run(argv)
        finally:
            _flush()
    except BrokenPipeError:  # a reader such as `head` has seen enough
        _discard_output()
        return 0
    except OSError as error:
        _discard_output()
        return fail(f"the standard output cannot be written: {error.strerror or error}")


def _run(argv: Sequence[str] | None) -> int:
    """Run the command that the arguments select; returns the exit code."""
    words = sys.argv[1:] if argv is None else list(argv)
    parser, commands = _parser()
    if not words or words[0] not in (*commands.choices, "--version"):
        is_any_added = _add_commands(commands)
        if words and not words[0].startswith("-") and words[0] not in commands.choices:
            problem = f"there is no command {words[0]!r}: choose one of {', '.join(commands.choices)}"
            return fail(problem if is_any_added else f"{problem}; {_INSTALL_AGAIN}")
    arguments = parser.parse_args(words)
    return arguments.run(arguments)


def _add_commands(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> bool:
    """Add the commands that other packages register; returns whether there are any."""
    from importlib.metadata import entry_points

    found = sorted(entry_points(group=_ADDED), key=lambda point: point.name)
    for point in found:
        try:
            point.load()(commands)
        except Exception as error:  # whatever an installation lacks: the other commands work without it
            reason = " ".join(str(error).split()) or type(error).__name__
            print(f"heatwalk: the command {point.name!r} is left out: {reason}", file=sys.stderr)
    commands.metavar = f"{{{','.join(commands.choices)}}}"
    return bool(found)


def read(arguments: argparse.Namespace, path: Path) -> "LoadedMesh | None":
    """A mesh as the arguments want it; None, and a message, if it cannot be read."""
    from heatwalk.io import read_mesh
    from heatwalk.meshes import MeshError

    try:
        return read_mesh(path, weld=arguments.weld)
    except MeshError as error:
        fail(error)
        return None


def _summarize(done: str, paths: Sequence[Path], failed: Sequence[Path]) -> int:
    """Print what became of several meshes; returns the exit code."""
    print(f"{_count(len(paths), 'mesh', 'meshes')}: {len(paths) - len(failed):,} {done}", end="")
    print(f", {len(failed):,} failed: {', '.join(map(str, failed))}" if failed else "")
    return 2 if failed else 0


def _flush() -> None:
    """Write what was printed, unless the process was started without a standard output."""
    if sys.stdout is not None:
        sys.stdout.flush()


def _discard_output() -> None:
    """Send what is still to be written to stdout nowhere, so that Python's exit does not fail again."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def _parser() -> tuple[argparse.ArgumentParser, "argparse._SubParsersAction[argparse.ArgumentParser]"]:
    """The parser of the arguments, and that of its commands; each command sets ``run``."""
    parser = argparse.ArgumentParser(
        prog="heatwalk",
        description="Segment triangle meshes by the pathways of largest heat-flow capacity (the Heat Walk).",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"heatwalk {__version__}")
    commands = parser.add_subparsers(metavar="{segment,inspect,example}", required=True)

    command = commands.add_parser(
        "segment",
        help="write the mesh coloured by segment (PLY) and the label of every face (.seg)",
        description="Segment a mesh. Writes the mesh coloured by segment, with the dissipator region in grey and the\n"
        "label of each vertex and its margin as properties, and next to it a .seg file with one label per face,\n"
        "in the order of the faces. The margin, from 0 to 1, is how far a label is from another one.",
        epilog="example:\n  heatwalk segment cow.obj --time 1 --output cow_segments.ply\n"
        "  heatwalk segment scan.ply --robust\n"
        "  heatwalk segment meshes --output segments",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_mesh(command)
    command.add_argument(
        "--time",
        type=positive_time,
        default=1.0,
        metavar="T",
        help="duration of the heat flow in the unit of the paper; longer times give fewer segments (default: 1)",
    )
    command.add_argument(
        "--robust",
        action="store_true",
        help="use the robust variant: nearly the same segments on noisy and damaged copies of a mesh, at a time near "
        "--time at which their number is stable",
    )
    command.add_argument(
        "--parts",
        action="store_true",
        help="with --robust: borders along concave creases, and limbs cut at their waists, which is nearer to what "
        "people see, and less stable",
    )
    command.add_argument(
        "--output",
        metavar="OUT.ply|FOLDER",
        help="default: the name of MESH with _segments.ply, in the current directory; of several meshes, next to each",
    )
    command.add_argument(
        "--threads",
        type=_positive_integer,
        metavar="N",
        help="how many threads share the work on a large mesh; the result does not depend on it (default: all "
        "processors that this process may use, or the number in OMP_NUM_THREADS)",
    )
    command.add_argument("--force", action="store_true", help="overwrite output files that this command did not write")
    command.set_defaults(run=_segment, reject=command.error)

    command = commands.add_parser(
        "inspect",
        help="report the properties of the mesh and whether it can be segmented",
        description="Report the properties of a mesh. The exit code is 0 if it can be segmented, 2 if not.",
    )
    _add_mesh(command)
    command.set_defaults(run=_inspect)

    command = commands.add_parser(
        "example",
        help="write a mesh to try the others on",
        description="Write a mesh that installed packages contain: a cow, a bunny or an ant.",
        epilog="example:\n  heatwalk example cow",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("name", nargs="?", default="cow", metavar="NAME", help="cow, bunny or ant (default: cow)")
    command.add_argument("--output", metavar="FILE", help="default: NAME with its suffix, in the current directory")
    command.add_argument("--force", action="store_true", help="overwrite a file with other contents")
    command.set_defaults(run=_example)
    return parser, commands


def _add_mesh(command: argparse.ArgumentParser) -> None:
    """Add the arguments that specify the mesh and how it is read."""
    command.add_argument("meshes", nargs="+", type=Path, metavar="MESH", help="a mesh file, or a folder of them")
    add_weld(command)


def add_weld(command: argparse.ArgumentParser) -> None:
    """Add the argument that specifies how a mesh is read."""
    command.add_argument(
        "--weld",
        type=_weld,
        metavar="exact|DISTANCE",
        help="merge vertices that coincide: exactly, or within a distance relative to the bounding-box diagonal, such "
        "as 1e-5 (default: none)",
    )


def _weld(text: str) -> str | float:
    """The value of --weld."""
    from heatwalk.io.welding import check_weld
    from heatwalk.meshes import MeshError

    weld: str | float = text
    with contextlib.suppress(ValueError):
        weld = float(text)
    try:
        check_weld(weld)
    except MeshError as error:
        raise argparse.ArgumentTypeError(str(error).partition(" ")[2] + f", got {text!r}") from error
    return weld


def positive_time(text: str) -> float:
    """The value of --time."""
    try:
        time = float(text)
    except ValueError:
        time = math.nan
    if not 0 < time < math.inf:
        raise argparse.ArgumentTypeError(f"must be a positive, finite number, got {text!r}")
    return time


def _positive_integer(text: str) -> int:
    """The value of --threads."""
    if not (text.isascii() and text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"must be a positive integer, got {text!r}")
    return int(text)


def fail(message: object) -> int:
    """Print an error; returns the exit code."""
    with contextlib.suppress(BrokenPipeError):
        print(f"heatwalk: error: {message}", file=sys.stderr)
    return 2


def _segment(arguments: argparse.Namespace) -> int:
    """``heatwalk segment``; returns the exit code."""
    if arguments.parts and not arguments.robust:
        arguments.reject("argument --parts: requires --robust")
    from heatwalk.batch import meshes_in
    from heatwalk.meshes import MeshError

    try:
        paths = meshes_in(arguments.meshes)
        outputs = _outputs(arguments, paths)
    except MeshError as error:
        return fail(error)
    except OSError as error:
        return fail(f"{error.filename}: cannot be written: {error.strerror}")
    if not _are_several(arguments):
        return 0 if _segment_one(arguments, paths[0], outputs[0]) else 2
    failed = []
    for path, output in zip(paths, outputs, strict=True):
        try:
            if _segment_one(arguments, path, output):
                print(flush=True)
            else:
                failed.append(path)
        except BrokenPipeError:  # nobody reads on, but the files are wanted
            _discard_output()
    return _summarize("segmented", paths, failed)


def _are_several(arguments: argparse.Namespace) -> bool:
    """Whether the arguments are several files, or a folder."""
    return len(arguments.meshes) > 1 or arguments.meshes[0].is_dir()


def _outputs(arguments: argparse.Namespace, paths: Sequence[Path]) -> list[Path]:
    """The PLY file for each mesh; a folder that they are to be written to is made."""
    from heatwalk.batch import outputs_for

    text = arguments.output
    if text is None:
        return outputs_for(paths, None if _are_several(arguments) else Path())
    is_folder = bool(text) and (text[-1] in (os.sep, os.altsep) or Path(text).is_dir())
    is_ply = Path(text).suffix.lower() == ".ply"
    if not _are_several(arguments) and is_ply:
        return [Path(text)]
    if not _are_several(arguments) and not is_folder:
        arguments.reject(f"argument --output: must end in .ply, or be a folder, got {text!r}")
    if not text or (is_ply and not is_folder):
        arguments.reject(f"argument --output: must be a folder for several meshes, got {text!r}")
    outputs = outputs_for(paths, Path(text))
    Path(text).mkdir(exist_ok=True)
    return outputs


def _segment_one(arguments: argparse.Namespace, path: Path, output: Path) -> bool:
    """Segment a mesh and write the result; returns whether that was possible."""
    mesh = read(arguments, path)
    if mesh is None:
        return False
    problem = _write_segments(arguments, path, mesh, output)
    if problem is not None:
        fail(problem)
    return problem is None


def _write_segments(arguments: argparse.Namespace, path: Path, mesh: "LoadedMesh", output: Path) -> str | None:
    """Segment a mesh and write the result; returns what made it impossible."""
    from heatwalk.io import write_ply, write_seg
    from heatwalk.io.seg import seg_bytes
    from heatwalk.meshes import MeshError
    from heatwalk.numerics.compilation import announced
    from heatwalk.numerics.threads import with_threads
    from heatwalk.robust.options import Options
    from heatwalk.robust.segmentation import segment_robust
    from heatwalk.segmentation import segment
    from heatwalk.spectrum import SpectrumError

    labels_output = output.with_suffix(".seg")
    # Checked before the segmentation, which may take long.
    if output.exists() and output.samefile(path):
        return f"{output}: the output would overwrite the mesh; choose another --output"
    if not output.parent.is_dir():
        return f"{output}: cannot be written: no such directory"
    foreign = None if arguments.force else _foreign_file(output, labels_output)
    if foreign is not None:
        return (
            f"{foreign}: exists, and this command did not write it; choose another --output, or overwrite it by --force"
        )
    try:
        with announced(announce_compilation):
            segmentation: Segmentation
            if arguments.robust:
                options = Options(refine=arguments.parts, hierarchy=arguments.parts)
                segmentation = segment_robust(
                    mesh.vertices, mesh.faces, time=arguments.time, options=options, threads=arguments.threads
                )
            else:
                segmentation = segment(mesh.vertices, mesh.faces, time=arguments.time, threads=arguments.threads)
    except (MeshError, SpectrumError) as error:
        return f"{path}: {error}"
    except MemoryError:
        return f"{path}: there is not enough memory to segment it"
    try:
        write_ply(
            output,
            mesh.vertices,
            mesh.faces,
            segmentation.labels,
            dissipator=len(segmentation.exemplars),
            comments=[_digest_comment(seg_bytes(segmentation.face_labels))],
            properties=with_threads(arguments.threads, _vertex_properties, segmentation),
        )
        write_seg(labels_output, segmentation.face_labels)
    except OSError as error:
        return f"{error.filename}: cannot be written: {error.strerror}"
    print_mesh(path, mesh)
    _print_segments(segmentation)
    print(f"written: {output}, {labels_output}")
    return None


def _vertex_properties(segmentation: "Segmentation") -> "dict[str, NDArray[np.float64]]":
    """The margin of each label; nothing, and a message, if that would take much longer than the labels."""
    import numpy as np

    if getattr(segmentation, "parts", None) is None:
        n_chosen = len(np.unique(segmentation.walk.pointer))
        if n_chosen * len(segmentation.labels) * segmentation.kernel.factor.shape[1] > _MOST_PRODUCTS:
            print(f"  note: the margin is not written, as {n_chosen:,} vertices attract others")
            return {}
    return {"margin": segmentation.margin}


def announce_compilation() -> None:
    """Say why the first segmentation takes longer than all others."""
    print("heatwalk: compiling, which takes about half a minute, once", file=sys.stderr, flush=True)


def _digest_comment(labels: bytes) -> str:
    """The comment of the PLY file that identifies the contents of the .seg file written with it."""
    return f"seg sha256 {hashlib.sha256(labels).hexdigest()}"


def _foreign_file(output: Path, labels: Path) -> Path | None:
    """An existing output file that this command did not write; None if there is none."""
    from heatwalk.io.ply import comments_of

    try:
        comments = comments_of(output) if output.is_file() else []
        if output.is_file() and "heatwalk" not in comments:
            return output
        return labels if labels.is_file() and _digest_comment(labels.read_bytes()) not in comments else None
    except OSError:  # the attempt to write it gives the reason
        return None


def _print_segments(segmentation: "Segmentation") -> None:
    """Print the number of regions, the sizes of the largest segments, and the seconds of each stage."""
    import numpy as np

    from heatwalk.robust.segmentation import RobustSegmentation

    n_accumulators, n_vertices = len(segmentation.exemplars), len(segmentation.labels)
    sizes = np.bincount(segmentation.labels, minlength=n_accumulators + 1)
    n_segments = int(np.count_nonzero(sizes))
    regions = _count(int(np.count_nonzero(sizes[:n_accumulators])), "accumulator region")
    dissipator = "a dissipator region" if sizes[n_accumulators] else "no dissipator region"
    components = f", {segmentation.n_components} components" if segmentation.n_components > 1 else ""
    print(f"{regions}, {dissipator}{components}")
    if isinstance(segmentation, RobustSegmentation):
        _print_choices(segmentation)
    print(f"\n{'segment':>12}  {'vertices':>10}  {'share':>6}")
    for label in np.argsort(-sizes, kind="stable")[: min(_MAX_ROWS, n_segments)]:
        name = "dissipator" if label == n_accumulators else label
        print(f"{name:>12}  {sizes[label]:>10,}  {sizes[label] / n_vertices:>6.1%}")
    if n_segments > _MAX_ROWS:
        print(f"{'…':>12}  {n_segments - _MAX_ROWS:>10,} smaller segments")
    seconds = {stage: seconds for stage, seconds in segmentation.seconds.items() if seconds or stage != "compilation"}
    print("\nseconds: " + ", ".join(f"{stage} {taken:.2f}" for stage, taken in seconds.items()))


def _print_choices(segmentation: "RobustSegmentation") -> None:
    """Print the time that was chosen, and what was repaired."""
    print(f"time {segmentation.time:.3g}, the nearest stable one to {segmentation.requested_time:.3g}")
    report = segmentation.repaired.report
    done = [
        _count(report[name], noun) + verb
        for name, noun, verb in (
            ("handles_cut", "handle", " cut"),
            ("holes_filled", "hole", " filled"),
            ("vertices_moved", "spike", " removed"),
        )
        if report[name]
    ]
    if done:
        print(f"repaired for measuring only: {', '.join(done)}")


def _inspect(arguments: argparse.Namespace) -> int:
    """``heatwalk inspect``; returns the exit code."""
    from heatwalk.batch import meshes_in
    from heatwalk.meshes import MeshError

    try:
        paths = meshes_in(arguments.meshes)
    except MeshError as error:
        return fail(error)
    failed = []
    for path in paths:
        if not _inspect_one(arguments, path):
            failed.append(path)
        elif _are_several(arguments):
            print(flush=True)
    if _are_several(arguments):
        return _summarize("can be segmented", paths, failed)
    return 2 if failed else 0


def _inspect_one(arguments: argparse.Namespace, path: Path) -> bool:
    """Print the properties of a mesh; returns whether it can be segmented."""
    from heatwalk.meshes import inspect_mesh

    mesh = read(arguments, path)
    if mesh is None:
        return False
    report = inspect_mesh(mesh.vertices, mesh.faces)
    print_mesh(path, mesh)
    for name, value in (
        ("components", report.n_components),
        ("boundary edges", f"{report.n_boundary_edges:,} in {_count(report.n_boundary_loops, 'loop')}"),
        ("non-manifold edges", report.n_nonmanifold_edges),
        ("degenerate faces", report.n_degenerate_faces),
        ("duplicate faces", report.n_duplicate_faces),
        ("coincident vertices", report.n_coincident_vertices),
        ("nearly coincident", report.n_nearly_coincident_vertices),
        ("watertight", report.is_watertight),
        ("consistently oriented", report.is_consistently_oriented),
        ("Euler characteristic", report.euler_characteristic),
        ("area", report.area),
        ("mean edge length", report.mean_edge_length),
        ("bounding-box diagonal", report.bounding_box_diagonal),
        ("can be segmented", report.problem is None),
    ):
        print(f"  {name:<22} {_format(value)}")
    if report.problem is not None:
        _flush()
        fail(f"{path}: {report.problem}")
    return report.problem is None


def _example(arguments: argparse.Namespace) -> int:
    """``heatwalk example``; returns the exit code."""
    from heatwalk.examples import example_path
    from heatwalk.io import read_mesh
    from heatwalk.meshes import MeshError

    try:
        source = example_path(arguments.name)
        mesh = read_mesh(source)
    except MeshError as error:
        return fail(error)
    output = Path(arguments.output or f"{arguments.name}{source.suffix}")
    if output.is_dir():
        output /= f"{arguments.name}{source.suffix}"
    if output.suffix.lower() != source.suffix:
        return fail(f"{output}: the mesh of {arguments.name!r} is a file {source.suffix}; choose such an --output")
    data = source.read_bytes()
    try:
        if output.exists() and not arguments.force and output.read_bytes() != data:
            return fail(f"{output}: exists with other contents; choose another --output, or overwrite it by --force")
        output.write_bytes(data)
    except OSError as error:
        return fail(f"{output}: cannot be written: {error.strerror}")
    print_mesh(output, mesh)
    print(f"written: {output}")
    return 0


def print_mesh(path: Path, mesh: "LoadedMesh") -> None:
    """Print the size of a mesh, and what was changed while reading it."""
    print(f"{path}: {len(mesh.vertices):,} vertices, {len(mesh.faces):,} faces")
    for note in mesh.notes:
        print(f"  note: {note}")


def _count(count: int, noun: str, plural: str = "") -> str:
    """A number with its noun in singular or plural."""
    return f"{count:,} {noun if count == 1 else plural or noun + 's'}"


def _format(value: object) -> str:
    """A value of the report as text."""
    match value:
        case bool():
            return "yes" if value else "no"
        case int():
            return f"{value:,}"
        case float():
            return f"{value:.6g}"
    return str(value)
