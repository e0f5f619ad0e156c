import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import heatwalk
from heatwalk.cli import main
from heatwalk.io import label_colours, read_mesh, read_seg
from heatwalk.numerics.threads import sharing_everything
from heatwalk.robust.options import Options
from tests.helpers.mesh_files import OCTAHEDRON, off_bytes
from tests.helpers.meshes import bundled_path

ROOT = Path(heatwalk.__file__).parents[1]


@pytest.fixture
def in_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def stderr_line(capsys):
    """The one line on stderr, of a command that printed nothing else there."""
    error = capsys.readouterr().err
    assert re.fullmatch(r"heatwalk: error: [^\n]+\n", error)
    return error.removeprefix("heatwalk: error: ").rstrip()


def test_segment_writes_the_result_of_the_function_into_the_current_directory(in_empty_folder, capsys):
    path = bundled_path("cow")
    assert main(["segment", str(path)]) == 0
    assert sorted(p.name for p in in_empty_folder.iterdir()) == ["cow_segments.ply", "cow_segments.seg"]

    cow = read_mesh(path)
    expected = heatwalk.segment(cow.vertices, cow.faces)
    assert np.array_equal(read_seg("cow_segments.seg"), expected.face_labels)
    written = trimesh.load("cow_segments.ply", process=False)
    assert np.array_equal(written.vertices, cow.vertices.astype(np.float32))
    assert np.array_equal(written.faces, cow.faces)
    colours = label_colours(expected.labels, dissipator=len(expected.exemplars))
    assert np.array_equal(written.visual.vertex_colors, colours)
    assert capsys.readouterr().err == ""


def test_segment_prints_the_size_of_every_segment(in_empty_folder, capsys):
    path = bundled_path("cow")
    main(["segment", str(path)])
    printed = capsys.readouterr().out
    cow = read_mesh(path)
    labels = heatwalk.segment(cow.vertices, cow.faces).labels
    rows = re.findall(r"^ +(\d+|dissipator) +([\d,]+) +([\d.]+)%$", printed, flags=re.MULTILINE)
    sizes = {name: int(size.replace(",", "")) for name, size, _ in rows}
    assert sum(sizes.values()) == len(cow.vertices)
    n_accumulators = labels.max()
    assert sizes.pop("dissipator") == np.count_nonzero(labels == n_accumulators)
    assert sizes == {str(label): np.count_nonzero(labels == label) for label in range(n_accumulators)}
    assert f"{n_accumulators} accumulator regions, a dissipator region" in printed
    assert "cow_segments.ply, cow_segments.seg" in printed


def test_segment_accepts_a_time_and_an_output(in_empty_folder, capsys):
    path = bundled_path("cow")
    assert main(["segment", str(path), "--time", "0.3", "--output", "a.b.PLY"]) == 0
    cow = read_mesh(path)
    expected = heatwalk.segment(cow.vertices, cow.faces, time=0.3)
    assert np.array_equal(read_seg("a.b.seg"), expected.face_labels)
    assert len(expected.exemplars) > len(heatwalk.segment(cow.vertices, cow.faces).exemplars)


@pytest.mark.parametrize("options", [[], ["--robust"]])
def test_files_do_not_depend_on_the_number_of_threads(options, in_empty_folder):
    with sharing_everything():
        for threads in ("1", "2"):
            output = ["--output", f"{threads}.ply", "--threads", threads]
            assert main(["segment", str(bundled_path("ant")), *output, *options]) == 0
    assert Path("1.ply").read_bytes() == Path("2.ply").read_bytes()
    assert Path("1.seg").read_bytes() == Path("2.seg").read_bytes()


@pytest.mark.parametrize("threads", ["0", "-1", "1.5", "all"])
def test_threads_that_are_no_positive_integer_are_rejected(threads, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["segment", "cow.obj", "--threads", threads])
    assert f"argument --threads: must be a positive integer, got '{threads}'" in capsys.readouterr().err


def test_segment_robust_writes_the_result_of_the_robust_variant(in_empty_folder, capsys):
    assert main(["segment", str(bundled_path("ant")), "--robust", "--time", "2", "--output", "ant.ply"]) == 0
    ant = read_mesh(bundled_path("ant"))
    expected = heatwalk.segment_robust(ant.vertices, ant.faces, time=2)
    assert np.array_equal(read_seg("ant.seg"), expected.face_labels)
    printed = capsys.readouterr().out
    assert f"{len(expected.exemplars)} accumulator regions" in printed
    assert f"time {expected.time:.3g}, the nearest stable one to 2\n" in printed
    assert not np.array_equal(expected.face_labels, heatwalk.segment(ant.vertices, ant.faces, time=2).face_labels)


def test_segment_robust_with_parts_writes_parts(in_empty_folder):
    assert main(["segment", str(bundled_path("ant")), "--robust", "--parts", "--output", "ant.ply"]) == 0
    ant = read_mesh(bundled_path("ant"))
    expected = heatwalk.segment_robust(ant.vertices, ant.faces, options=Options(refine=True, hierarchy=True))
    assert np.array_equal(read_seg("ant.seg"), expected.face_labels)


def test_parts_require_the_robust_variant(in_empty_folder, capsys):
    with pytest.raises(SystemExit):
        main(["segment", str(bundled_path("ant")), "--parts"])
    assert "argument --parts: requires --robust\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "segment"), [([], heatwalk.segment), (["--robust"], heatwalk.segment_robust)], ids=["paper", "robust"]
)
def test_segment_writes_labels_and_their_margins_as_properties_of_the_vertices(in_empty_folder, options, segment):
    assert main(["segment", str(bundled_path("cow")), "--output", "cow.ply", *options]) == 0
    cow = read_mesh(bundled_path("cow"))
    expected = segment(cow.vertices, cow.faces)
    written = trimesh.load("cow.ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
    assert np.array_equal(written["label"], expected.labels)
    assert np.array_equal(written["margin"], expected.margin)


def test_margins_that_would_take_long_are_left_out_with_a_note(in_empty_folder, capsys, monkeypatch):
    monkeypatch.setattr("heatwalk.cli._MOST_PRODUCTS", 1)
    assert main(["segment", str(bundled_path("cow")), "--output", "cow.ply"]) == 0
    assert "note: the margin is not written, as " in capsys.readouterr().out
    assert "margin" not in trimesh.load("cow.ply", process=False).metadata["_ply_raw"]["vertex"]["data"].dtype.names


def test_segment_robust_tells_what_it_repaired(in_empty_folder, capsys):
    ball = trimesh.creation.icosphere(2)
    ball.vertices[40] *= 2
    ball.update_faces(np.arange(len(ball.faces)) >= 1)
    ball.export("ball.ply")
    assert main(["segment", "ball.ply", "--robust"]) == 0
    assert "repaired for measuring only: 1 hole filled, 1 spike removed\n" in capsys.readouterr().out


def test_segment_lists_the_twenty_largest_segments_and_counts_the_rest(in_empty_folder, capsys):
    ant = read_mesh(bundled_path("ant"))
    n_segments = heatwalk.segment(ant.vertices, ant.faces).n_segments
    assert n_segments > 20
    main(["segment", str(bundled_path("ant"))])
    printed = capsys.readouterr().out
    assert len(re.findall(r"^ +(?:\d+|dissipator) .*%$", printed, flags=re.MULTILINE)) == 20
    assert f"{n_segments - 20} smaller segments" in printed
    assert f"{heatwalk.inspect_mesh(ant.vertices, ant.faces).n_components} components" in printed


def test_changes_made_while_reading_are_printed(in_empty_folder, capsys):
    for command in ("segment", "inspect"):
        assert main([command, str(bundled_path("bone"))]) == 0
        assert "  note: dropped 359 vertices that belong to no face\n" in capsys.readouterr().out


def test_inspect_prints_the_report(capsys):
    assert main(["inspect", str(bundled_path("bunny"))]) == 0
    printed = dict(re.findall(r"^  (\S+(?: \S+)*)  +(.+)$", capsys.readouterr().out, flags=re.MULTILINE))
    bunny = read_mesh(bundled_path("bunny"))
    report = heatwalk.inspect_mesh(bunny.vertices, bunny.faces)
    assert printed == {
        "components": f"{report.n_components}",
        "boundary edges": f"{report.n_boundary_edges} in {report.n_boundary_loops} loops",
        "non-manifold edges": f"{report.n_nonmanifold_edges}",
        "degenerate faces": f"{report.n_degenerate_faces}",
        "duplicate faces": f"{report.n_duplicate_faces}",
        "coincident vertices": f"{report.n_coincident_vertices}",
        "nearly coincident": f"{report.n_nearly_coincident_vertices}",
        "watertight": "yes" if report.is_watertight else "no",
        "consistently oriented": "yes" if report.is_consistently_oriented else "no",
        "Euler characteristic": f"{report.euler_characteristic}",
        "area": f"{report.area:.6g}",
        "mean edge length": f"{report.mean_edge_length:.6g}",
        "bounding-box diagonal": f"{report.bounding_box_diagonal:.6g}",
        "can be segmented": "yes",
    }


def test_inspect_reports_why_a_mesh_cannot_be_segmented(in_empty_folder, capsys):
    Path("flat.off").write_text("OFF\n4 2 0\n0 0 0\n1 0 0\n2 0 0\n3 0 0\n3 0 1 2\n3 1 2 3\n")
    assert main(["inspect", "flat.off"]) == 2
    printed = capsys.readouterr()
    assert re.search(r"can be segmented +no\n", printed.out)
    assert printed.err == "heatwalk: error: flat.off: all 2 triangles are degenerate: the mesh has no area\n"


@pytest.mark.parametrize("time", ["0", "-1", "nan", "inf", "long"])
def test_a_time_that_is_not_positive_and_finite_is_rejected(time, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["segment", "cow.obj", f"--time={time}"])
    assert stopped.value.code == 2
    assert f"argument --time: must be a positive, finite number, got '{time}'" in capsys.readouterr().err


@pytest.mark.parametrize("output", ["out.obj", "out", "ply", ""])
def test_an_output_that_is_not_a_ply_file_is_rejected(output, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["segment", "cow.obj", "--output", output])
    assert stopped.value.code == 2
    assert f"argument --output: must end in .ply, or be a folder, got '{output}'" in capsys.readouterr().err


def test_an_output_folder_that_does_not_exist_is_rejected(in_empty_folder, capsys):
    assert main(["segment", str(bundled_path("ant")), "--output", "gone/ant.ply"]) == 2
    assert stderr_line(capsys) == "gone/ant.ply: cannot be written: no such directory"


def test_an_output_that_cannot_be_written_is_rejected(in_empty_folder, capsys):
    Path("ant.ply").mkdir()
    assert main(["segment", str(bundled_path("ant")), "--output", "ant.ply"]) == 2
    assert stderr_line(capsys) == "ant.ply: cannot be written: Is a directory"


def test_the_output_never_overwrites_the_mesh(in_empty_folder, capsys):
    data = bundled_path("ant").read_bytes()
    Path("ant.ply").write_bytes(data)
    assert main(["segment", "ant.ply", "--output", "./ant.ply"]) == 2
    assert "would overwrite the mesh" in stderr_line(capsys)
    assert Path("ant.ply").read_bytes() == data


def test_version_and_help_are_printed(capsys):
    for arguments in (["--version"], ["--help"], ["segment", "--help"], ["inspect", "--help"]):
        with pytest.raises(SystemExit) as stopped:
            main(arguments)
        assert stopped.value.code == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"heatwalk {heatwalk.__version__}\n")
    assert "heatwalk segment cow.obj --time 1 --output cow_segments.ply" in printed


def test_no_command_is_rejected(capsys):
    with pytest.raises(SystemExit) as stopped:
        main([])
    assert stopped.value.code == 2


PROGRAM = "from heatwalk.cli import main; raise SystemExit(main())"


def test_a_bad_mesh_ends_the_process_with_one_line_and_exit_code_2(interpreter, tmp_path):
    path = tmp_path / "bad.off"
    path.write_text("OFF\n4 4 0\n0 0 0\n")
    process = interpreter.run(["-c", PROGRAM, "segment", path], tmp_path)
    assert process.returncode == 2
    assert process.stdout == ""
    assert process.stderr == f"heatwalk: error: {path}: declares 4 vertices but contains 1: the file is truncated\n"


def test_log_messages_of_trimesh_do_not_reach_the_user(interpreter, tmp_path):
    path = tmp_path / "normals.stl"
    facets = "".join(
        "facet normal of words\nouter loop\n" + "".join(f"vertex {v}\n" for v in corners) + "endloop\nendfacet\n"
        for corners in (["0 0 0", "0 1 0", "1 0 0"], ["0 0 0", "1 0 0", "0 0 1"], ["1 0 0", "0 1 0", "0 0 1"])
    )
    path.write_text(f"solid\n{facets}endsolid\n")
    process = interpreter.run(["-c", PROGRAM, "inspect", path], tmp_path)
    assert process.returncode == 0
    assert "4 vertices, 3 faces" in process.stdout
    assert process.stderr == ""


def test_files_that_the_command_did_not_write_are_overwritten_by_force_only(in_empty_folder, capsys):
    ground_truth = "0\n1\n" * 10
    Path("12.seg").write_text(ground_truth)
    command = ["segment", str(bundled_path("cow")), "--output", "12.ply"]
    assert main(command) == 2
    message = "exists, and this command did not write it; choose another --output, or overwrite it by --force"
    assert stderr_line(capsys) == f"12.seg: {message}"
    assert Path("12.seg").read_text() == ground_truth
    assert not Path("12.ply").exists()
    assert main([*command, "--force"]) == 0
    labels = read_seg("12.seg")
    assert main([*command, "--time", "2"]) == 0  # its own files
    assert not np.array_equal(read_seg("12.seg"), labels)

    Path("12.seg").write_text(ground_truth)  # the file next to 12.ply is another one now
    assert main(command) == 2
    assert "12.seg: exists" in stderr_line(capsys)
    Path("12.seg").unlink()
    Path("12.ply").write_bytes(bundled_path("ant").read_bytes())
    assert main(command) == 2
    assert stderr_line(capsys) == f"12.ply: {message}"
    assert Path("12.ply").read_bytes() == bundled_path("ant").read_bytes()


def test_welding_is_an_option_of_both_commands(in_empty_folder, capsys):
    cow = read_mesh(bundled_path("cow"))
    corners = cow.vertices[cow.faces].reshape(-1, 3)
    rows = [
        *(" ".join(map(repr, row)) for row in corners.tolist()),
        *(f"3 {i} {i + 1} {i + 2}" for i in range(0, len(corners), 3)),
    ]
    Path("soup.off").write_text(f"OFF\n{len(corners)} {len(cow.faces)} 0\n" + "\n".join(rows))
    n_positions = len(np.unique(corners, axis=0))
    for arguments in (["inspect"], ["segment"]):
        assert main([*arguments, "soup.off", "--weld", "exact"]) == 0
        printed = capsys.readouterr().out
        assert f"soup.off: {n_positions:,} vertices, {len(cow.faces):,} faces\n" in printed
        assert f"  note: welded {len(corners):,} vertices into {n_positions:,}\n" in printed
    for weld in ("near", "0", "-1", "1", "nan"):
        with pytest.raises(SystemExit) as stopped:
            main(["inspect", "soup.off", f"--weld={weld}"])
        assert stopped.value.code == 2
        assert "argument --weld: must be 'exact' or a positive number below 1" in capsys.readouterr().err


def script(arguments, tail="", **environment):
    """Run the command in a shell, with what follows it there: (exit code of the command, stdout, stderr)."""
    command = shlex.join([sys.executable, "-c", PROGRAM, *map(str, arguments)])
    process = subprocess.run(
        ["bash", "-c", f"{command} {tail}; echo ${{PIPESTATUS[0]}}"],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
    )
    *output, code = process.stdout.decode().rstrip().split("\n")
    return int(code), "\n".join(output), process.stderr.decode()


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_a_terminal_of_any_encoding_is_written_to(interpreter, tmp_path, encoding):
    def run(*arguments):
        return interpreter.run(["-c", PROGRAM, *arguments], tmp_path, {"PYTHONIOENCODING": encoding})

    path = tmp_path / "ant …\u4e2d.ply"
    path.write_bytes(bundled_path("ant").read_bytes())
    for arguments in (["segment", path, "--output", tmp_path / "…out.ply"], ["inspect", path], ["--help"]):
        done = run(*arguments)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout
    done = run("inspect", tmp_path / "gone….off")
    assert done.returncode == 2
    assert "cannot be read: No such file or directory" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", [["segment"], ["inspect"], ["--help"], ["segment", "--help"]])
def test_a_reader_that_ends_early_is_no_error(tmp_path, command):
    mesh = [] if "--help" in command else [bundled_path("ant")]
    output = ["--output", tmp_path / "out.ply"] if command == ["segment"] else []
    for tail in ("| head -1 > /dev/null", "| true", "| (exec <&-; sleep 0.1)"):
        code, _, error = script([*command, *mesh, *output], tail)
        assert (code, error) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_an_output_that_cannot_be_written_to_is_one_line():
    code, _, error = script(["inspect", bundled_path("ant")], "> /dev/full")
    assert code == 2
    assert error == "heatwalk: error: the standard output cannot be written: No space left on device\n"


def test_a_cache_folder_that_cannot_be_written_is_done_without(tmp_path):
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", tmp_path / "file" / "below", "/proc/nowhere"):
        code, output, error = script(["inspect", bundled_path("ant")], NUMBA_CACHE_DIR=str(folder))
        assert (code, error) == (0, "")
        assert "can be segmented" in output


def test_a_full_disk_of_the_cache_is_done_without(tmp_path):
    resource = pytest.importorskip("resource")  # not on Windows
    assert resource.RLIMIT_FSIZE is not None
    program = (
        "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0));"
        "from heatwalk.cli import main; sys.exit(main())"
    )
    process = subprocess.run(
        [sys.executable, "-c", program, "inspect", str(bundled_path("ant"))],
        cwd=ROOT,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert (process.returncode, process.stderr) == (0, "")
    assert "can be segmented" in process.stdout


def test_all_meshes_of_a_folder_are_written_though_nobody_reads_on(tmp_path):
    for name in "abc":
        (tmp_path / f"{name}.off").write_bytes(off_bytes(OCTAHEDRON.vertices, OCTAHEDRON.faces))
    code, _, error = script(["segment", tmp_path, tmp_path / "gone.off"], "| true")
    assert code == 2
    assert error.startswith(f"heatwalk: error: {tmp_path / 'gone.off'}: cannot be read: ")
    assert len(list(tmp_path.glob("*_segments.seg"))) == 3


def test_a_closed_output_is_done_without(tmp_path):
    path = bundled_path("ant")
    for arguments, expected in ((["inspect", path], 0), (["inspect", tmp_path / "gone.off"], 2), (["--version"], 0)):
        code, _, error = script(arguments, ">&-")
        assert (code, "Traceback" in error) == (expected, False)


def test_commands_of_other_packages_are_not_looked_for_where_one_of_this_package_is_typed(monkeypatch, capsys):
    looked_for = []
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: looked_for.append(group) or [])
    assert main(["inspect", str(bundled_path("ant"))]) == 0
    assert looked_for == []
    assert main(["inspekt", str(bundled_path("ant"))]) == 2
    assert looked_for == ["heatwalk.commands"]
    assert stderr_line(capsys).startswith("there is no command 'inspekt': choose one of segment, inspect, example;")
