"""The command ``heatwalk``: segment a mesh file, or report on it."""

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
    from heatwalk.io import LoadedMesh
    from heatwalk.segmentation import Segmentation

# SciPy and numba are imported by the commands that use them: `heatwalk --help` should not wait for them.

_EXAMPLE = """\
example:
  heatwalk inspect cow.obj
  heatwalk segment cow.obj --time 1 --output cow_segments.ply

mesh files: OFF, OBJ, PLY or STL
"""

# Rows of the table of segments, the largest first: symmetric shapes can have hundreds.
_MAX_ROWS = 20


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
            sys.stdout.flush()
    except BrokenPipeError:  # a reader such as `head` has seen enough
        _discard_output()
        return 0
    except OSError as error:
        _discard_output()
        return _fail(f"the standard output cannot be written: {error.strerror or error}")


def _run(argv: Sequence[str] | None) -> int:
    """Run the command that the arguments select; returns the exit code."""
    arguments = _parser().parse_args(argv)

    from heatwalk.io import read_mesh
    from heatwalk.meshes import MeshError

    try:
        mesh = read_mesh(arguments.mesh, weld=arguments.weld)
    except MeshError as error:
        return _fail(error)
    return arguments.run(arguments, mesh)


def _discard_output() -> None:
    """Send what is still to be written to stdout nowhere, so that Python's exit does not fail again."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def _parser() -> argparse.ArgumentParser:
    """The parser of the arguments; each command sets ``run``."""
    parser = argparse.ArgumentParser(
        prog="heatwalk",
        description="Segment triangle meshes by the pathways of largest heat-flow capacity (the Heat Walk).",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"heatwalk {__version__}")
    commands = parser.add_subparsers(metavar="{segment,inspect}", required=True)

    command = commands.add_parser(
        "segment",
        help="write the mesh coloured by segment (PLY) and the label of every face (.seg)",
        description="Segment a mesh. Writes the mesh coloured by segment, with the dissipator region in grey,\n"
        "and next to it a .seg file with one label per face, in the order of the faces.",
        epilog="example:\n  heatwalk segment cow.obj --time 1 --output cow_segments.ply",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_mesh(command)
    command.add_argument(
        "--time",
        type=_time,
        default=1.0,
        metavar="T",
        help="duration of the heat flow in the unit of the paper; longer times give fewer segments (default: 1)",
    )
    command.add_argument(
        "--output",
        type=_ply_path,
        metavar="OUT.ply",
        help="default: the name of MESH with _segments.ply, in the current directory",
    )
    command.add_argument("--force", action="store_true", help="overwrite output files that this command did not write")
    command.set_defaults(run=_segment)

    command = commands.add_parser(
        "inspect",
        help="report the properties of the mesh and whether it can be segmented",
        description="Report the properties of a mesh. The exit code is 0 if it can be segmented, 2 if not.",
    )
    _add_mesh(command)
    command.set_defaults(run=_inspect)
    return parser


def _add_mesh(command: argparse.ArgumentParser) -> None:
    """Add the arguments that specify the mesh and how it is read."""
    command.add_argument("mesh", metavar="MESH", help="an OFF, OBJ, PLY or STL file")
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


def _time(text: str) -> float:
    """The value of --time."""
    try:
        time = float(text)
    except ValueError:
        time = math.nan
    if not 0 < time < math.inf:
        raise argparse.ArgumentTypeError(f"must be a positive, finite number, got {text!r}")
    return time


def _ply_path(text: str) -> Path:
    """The value of --output."""
    path = Path(text)
    if path.suffix.lower() != ".ply":
        raise argparse.ArgumentTypeError(f"must end in .ply, got {text!r}")
    return path


def _fail(message: object) -> int:
    """Print an error; returns the exit code."""
    print(f"heatwalk: error: {message}", file=sys.stderr)
    return 2


def _segment(arguments: argparse.Namespace, mesh: "LoadedMesh") -> int:
    """``heatwalk segment``; returns the exit code."""
    from heatwalk.io import write_ply, write_seg
    from heatwalk.io.seg import seg_bytes
    from heatwalk.meshes import MeshError
    from heatwalk.numerics.compilation import announced
    from heatwalk.segmentation import segment
    from heatwalk.spectrum import SpectrumError

    output = arguments.output or Path(f"{Path(arguments.mesh).stem}_segments.ply")
    labels_output = output.with_suffix(".seg")
    # Checked before the segmentation, which may take long.
    if output.exists() and output.samefile(arguments.mesh):
        return _fail(f"{output}: the output would overwrite the mesh; choose another --output")
    if not output.parent.is_dir():
        return _fail(f"{output}: cannot be written: no such directory")
    foreign = None if arguments.force else _foreign_file(output, labels_output)
    if foreign is not None:
        return _fail(
            f"{foreign}: exists, and this command did not write it; choose another --output, or overwrite it by --force"
        )
    try:
        with announced(_announce_compilation):
            segmentation = segment(mesh.vertices, mesh.faces, time=arguments.time)
    except (MeshError, SpectrumError) as error:
        return _fail(f"{arguments.mesh}: {error}")
    try:
        write_ply(
            output,
            mesh.vertices,
            mesh.faces,
            segmentation.labels,
            dissipator=len(segmentation.exemplars),
            comments=[_digest_comment(seg_bytes(segmentation.face_labels))],
        )
        write_seg(labels_output, segmentation.face_labels)
    except OSError as error:
        return _fail(f"{error.filename}: cannot be written: {error.strerror}")

    _print_mesh(arguments.mesh, mesh)
    _print_segments(segmentation)
    print(f"written: {output}, {labels_output}")
    return 0


def _announce_compilation() -> None:
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

    n_accumulators, n_vertices = len(segmentation.exemplars), len(segmentation.labels)
    sizes = np.bincount(segmentation.labels, minlength=n_accumulators + 1)
    n_segments = int(np.count_nonzero(sizes))
    regions = _count(int(np.count_nonzero(sizes[:n_accumulators])), "accumulator region")
    dissipator = "a dissipator region" if sizes[n_accumulators] else "no dissipator region"
    components = f", {segmentation.n_components} components" if segmentation.n_components > 1 else ""
    print(f"{regions}, {dissipator}{components}")
    print(f"\n{'segment':>12}  {'vertices':>10}  {'share':>6}")
    for label in np.argsort(-sizes, kind="stable")[: min(_MAX_ROWS, n_segments)]:
        name = "dissipator" if label == n_accumulators else label
        print(f"{name:>12}  {sizes[label]:>10,}  {sizes[label] / n_vertices:>6.1%}")
    if n_segments > _MAX_ROWS:
        print(f"{'…':>12}  {n_segments - _MAX_ROWS:>10,} smaller segments")
    seconds = {stage: seconds for stage, seconds in segmentation.seconds.items() if seconds or stage != "compilation"}
    print("\nseconds: " + ", ".join(f"{stage} {taken:.2f}" for stage, taken in seconds.items()))


def _inspect(arguments: argparse.Namespace, mesh: "LoadedMesh") -> int:
    """``heatwalk inspect``; returns the exit code."""
    from heatwalk.meshes import inspect_mesh

    report = inspect_mesh(mesh.vertices, mesh.faces)
    _print_mesh(arguments.mesh, mesh)
    for name, value in (
        ("components", report.n_components),
        ("boundary edges", f"{report.n_boundary_edges:,} in {_count(report.n_boundary_loops, 'loop')}"),
        ("non-manifold edges", report.n_nonmanifold_edges),
        ("degenerate faces", report.n_degenerate_faces),
        ("duplicate faces", report.n_duplicate_faces),
        ("watertight", report.is_watertight),
        ("consistently oriented", report.is_consistently_oriented),
        ("Euler characteristic", report.euler_characteristic),
        ("area", report.area),
        ("mean edge length", report.mean_edge_length),
        ("bounding-box diagonal", report.bounding_box_diagonal),
        ("can be segmented", report.problem is None),
    ):
        print(f"  {name:<22} {_format(value)}")
    return 0 if report.problem is None else _fail(f"{arguments.mesh}: {report.problem}")


def _print_mesh(path: str, mesh: "LoadedMesh") -> None:
    """Print the size of a mesh, and what was changed while reading it."""
    print(f"{path}: {len(mesh.vertices):,} vertices, {len(mesh.faces):,} faces")
    for note in mesh.notes:
        print(f"  note: {note}")


def _count(count: int, noun: str) -> str:
    """A number with its noun in singular or plural."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


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
