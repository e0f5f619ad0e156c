"""The command `heatwalk`: segment a mesh in a file, or say what it is."""

import argparse
import math
import sys
from pathlib import Path

import numpy as np

from heatwalk import __version__
from heatwalk.io import read_mesh, write_ply, write_seg
from heatwalk.meshes import MeshError, inspect_mesh
from heatwalk.segmentation import segment
from heatwalk.spectrum import SpectrumError

_EXAMPLE = """\
example:
  heatwalk inspect cow.obj
  heatwalk segment cow.obj --time 1 --output cow_segments.ply

meshes are read from OFF, OBJ, PLY and STL files
"""

_ROWS_SHOWN = 20  # of the table of segments, the largest first: symmetric shapes can have hundreds


def main(argv=None):
    """Run the command.

    Parameters
    ----------
    argv : list of str, optional
        the arguments, by default those of the process

    Returns
    -------
    int
        0; or 2 where the mesh cannot be segmented or a file cannot be read or written, with one line that
        says why on stderr

    Raises
    ------
    SystemExit
        by argparse, for --help, --version and arguments that it refuses
    """
    arguments = _parser().parse_args(argv)
    try:
        mesh = read_mesh(arguments.mesh)
    except MeshError as error:
        return _fail(error)
    return arguments.run(arguments, mesh)


def _parser():
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
        help="write the mesh coloured by segment (PLY), and the label of every face (.seg)",
        description="Segment a mesh; write it coloured by segment, the dissipator region grey, and\n"
        "beside it a .seg file with one label a face, in the order of the faces.",
        epilog="example:\n  heatwalk segment cow.obj --time 1 --output cow_segments.ply",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("mesh", metavar="MESH", help="an OFF, OBJ, PLY or STL file")
    command.add_argument(
        "--time",
        type=_time,
        default=1.0,
        metavar="T",
        help="how long heat flows, in the paper's unit: the longer, the fewer segments (default: 1)",
    )
    command.add_argument(
        "--output",
        type=_ply_path,
        metavar="OUT.ply",
        help="default: MESH's name with _segments.ply, in the current directory",
    )
    command.set_defaults(run=_segment)

    command = commands.add_parser(
        "inspect",
        help="say what the mesh is, and whether it can be segmented",
        description="Say what a mesh is, and whether it can be segmented: exit code 0 if it can, 2 if not.",
    )
    command.add_argument("mesh", metavar="MESH", help="an OFF, OBJ, PLY or STL file")
    command.set_defaults(run=_inspect)
    return parser


def _time(text):
    try:
        time = float(text)
    except ValueError:
        time = math.nan
    if not 0 < time < math.inf:
        raise argparse.ArgumentTypeError(f"must be a positive, finite number, got {text!r}")
    return time


def _ply_path(text):
    path = Path(text)
    if path.suffix.lower() != ".ply":
        raise argparse.ArgumentTypeError(f"must end in .ply, got {text!r}")
    return path


def _fail(message):
    print(f"heatwalk: error: {message}", file=sys.stderr)
    return 2


def _segment(arguments, mesh):
    output = arguments.output or Path(f"{Path(arguments.mesh).stem}_segments.ply")
    labels_output = output.with_suffix(".seg")
    # Before the work, which may take long.
    if output.exists() and output.samefile(arguments.mesh):
        return _fail(f"{output}: the output would overwrite the mesh; give another --output")
    if not output.parent.is_dir():
        return _fail(f"{output}: cannot be written: no such directory")
    try:
        segmentation = segment(mesh.vertices, mesh.faces, time=arguments.time)
    except (MeshError, SpectrumError) as error:
        return _fail(f"{arguments.mesh}: {error}")

    dissipator = len(segmentation.exemplars)
    try:
        write_ply(output, mesh.vertices, mesh.faces, segmentation.labels, dissipator)
        write_seg(labels_output, segmentation.face_labels)
    except OSError as error:
        return _fail(f"{error.filename}: cannot be written: {error.strerror}")

    _print_mesh(arguments.mesh, mesh)
    sizes = np.bincount(segmentation.labels, minlength=dissipator + 1)
    regions = _of(np.count_nonzero(sizes[:dissipator]), "accumulator region")
    components = f", {segmentation.n_components} components" if segmentation.n_components > 1 else ""
    print(f"{regions}, {'a' if sizes[dissipator] else 'no'} dissipator region{components}")
    print(f"\n{'segment':>12}  {'vertices':>10}  {'share':>6}")
    for label in np.argsort(-sizes, kind="stable")[: min(_ROWS_SHOWN, np.count_nonzero(sizes))]:
        name = "dissipator" if label == dissipator else label
        print(f"{name:>12}  {sizes[label]:>10,}  {sizes[label] / len(mesh.vertices):>6.1%}")
    if segmentation.n_segments > _ROWS_SHOWN:
        print(f"{'…':>12}  {segmentation.n_segments - _ROWS_SHOWN:>10,} smaller segments")
    print("\nseconds: " + ", ".join(f"{stage} {t:.2f}" for stage, t in segmentation.seconds.items()))
    print(f"written: {output}, {labels_output}")
    return 0


def _inspect(arguments, mesh):
    report = inspect_mesh(mesh.vertices, mesh.faces)
    _print_mesh(arguments.mesh, mesh)
    for name, value in (
        ("components", report.n_components),
        ("boundary edges", f"{report.n_boundary_edges:,} in {_of(report.n_boundary_loops, 'loop')}"),
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
        print(f"  {name:<22} {_shown(value)}")
    return 0 if report.problem is None else _fail(f"{arguments.mesh}: {report.problem}")


def _print_mesh(path, mesh):
    print(f"{path}: {len(mesh.vertices):,} vertices, {len(mesh.faces):,} faces")
    for note in mesh.notes:
        print(f"  note: {note}")


def _of(count, noun):
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def _shown(value):
    match value:
        case bool():
            return "yes" if value else "no"
        case int():
            return f"{value:,}"
        case float():
            return f"{value:.6g}"
    return value
