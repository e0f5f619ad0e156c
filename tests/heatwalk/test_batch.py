import gzip
import re
from pathlib import Path

import numpy as np
import pytest

import heatwalk
from heatwalk.cli import main
from heatwalk.examples import EXAMPLES, example_path
from heatwalk.io import read_mesh, read_seg
from tests.helpers.mesh_files import OCTAHEDRON, off_bytes, ply_bytes
from tests.helpers.meshes import bundled_path

OFF = off_bytes(OCTAHEDRON.vertices, OCTAHEDRON.faces)
PLY = ply_bytes(OCTAHEDRON.vertices, OCTAHEDRON.faces, "ascii")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with a folder of meshes."""
    monkeypatch.chdir(tmp_path)
    meshes = tmp_path / "meshes"
    (meshes / "below").mkdir(parents=True)
    for name, data in {
        "b.off": OFF, "a.OFF": OFF, "c.ply": PLY, "d.off.gz": gzip.compress(OFF), "._a.off": b"\0", "notes.txt": b"no",
        "below/e.off": OFF,
    }.items():  # fmt: skip
        (meshes / name).write_bytes(data)
    return tmp_path


def names(path):
    return sorted(file.name for file in Path(path).iterdir())


def test_the_meshes_of_a_folder_are_segmented_next_to_each(folder, capsys):
    before = names("meshes")
    assert main(["segment", "meshes"]) == 0
    written = {f"{name}_segments{suffix}" for name in "abcd" for suffix in (".ply", ".seg")}
    assert names("meshes") == sorted({*before, *written})
    assert names(folder) == ["meshes"]
    printed = capsys.readouterr()
    assert printed.out.endswith("\n4 meshes: 4 segmented\n")
    assert printed.err == ""
    expected = heatwalk.segment(OCTAHEDRON.vertices, OCTAHEDRON.faces)
    assert np.array_equal(read_seg("meshes/d_segments.seg"), expected.face_labels)


def test_a_second_run_leaves_out_what_the_first_one_wrote(folder, capsys):
    for _ in range(2):
        assert main(["segment", "meshes", "--output", "out"]) == 0
        assert main(["segment", "meshes"]) == 0
        assert capsys.readouterr().out.count("4 meshes: 4 segmented\n") == 2
    assert names("out") == sorted(f"{name}_segments{suffix}" for name in "abcd" for suffix in (".ply", ".seg"))
    assert main(["segment", "out"]) == 2
    assert (
        "out: the folder contains no mesh itself (subfolders are not searched); supported: .off, .obj, "
        in capsys.readouterr().err
    )


@pytest.mark.parametrize("output", ["new", "new/", "old", "old/"])
def test_several_files_are_written_to_the_folder_of_the_output(folder, output):
    Path("old").mkdir()
    assert main(["segment", "meshes/a.OFF", "meshes/below/e.off", "meshes/a.OFF", "--output", output]) == 0
    assert names(output) == ["a_segments.ply", "a_segments.seg", "e_segments.ply", "e_segments.seg"]


def test_one_mesh_can_be_written_to_a_folder_too(folder):
    Path("old").mkdir()
    for output in ("old", "old/", "new/"):
        assert main(["segment", "meshes/d.off.gz", "--output", output]) == 0
        assert names(output) == ["d_segments.ply", "d_segments.seg"]


def test_a_failure_does_not_end_the_others_and_the_exit_code_says_so(folder, capsys):
    Path("meshes/b.off").write_bytes(b"OFF\n4 4 0\n0 0 0\n")
    Path("meshes/c.ply").write_bytes(ply_bytes(np.zeros((4, 3)), OCTAHEDRON.faces[:1] % 4, "ascii"))
    Path("meshes/d_segments.seg").write_text("0\n")
    assert main(["segment", "meshes", "gone.off", "--weld", "exact"]) == 2
    printed = capsys.readouterr()
    errors = printed.err.splitlines()
    assert [re.match(r"heatwalk: error: (\S+): ", line)[1] for line in errors] == [
        str(Path("meshes", "b.off")),
        str(Path("meshes", "c.ply")),
        str(Path("meshes", "d_segments.seg")),
        "gone.off",
    ]
    failed = ", ".join(map(str, [*(Path("meshes", name) for name in ("b.off", "c.ply", "d.off.gz")), "gone.off"]))
    assert printed.out.endswith(f"\n5 meshes: 1 segmented, 4 failed: {failed}\n")
    assert Path("meshes/a_segments.ply").is_file()
    assert Path("meshes/d_segments.seg").read_text() == "0\n"


def test_meshes_of_one_name_are_kept_apart_by_their_suffix_or_refused(folder, capsys):
    Path("meshes/b.ply").write_bytes(PLY)
    assert main(["segment", "meshes", "--output", "out"]) == 0
    assert {"b.off_segments.ply", "b.ply_segments.ply", "a_segments.ply"} <= set(names("out"))
    Path("meshes/below/a.OFF").write_bytes(OFF)
    assert main(["segment", "meshes", "meshes/below", "--output", "other"]) == 2
    assert "would both be written to" in capsys.readouterr().err
    assert not Path("other").exists()
    assert main(["segment", "meshes/a.OFF", "meshes/below/a.OFF"]) == 0  # next to each


@pytest.mark.parametrize("output", ["one.ply", ""])
def test_one_file_as_the_output_of_several_is_a_mistake(folder, capsys, output):
    with pytest.raises(SystemExit) as stopped:
        main(["segment", "meshes", "--output", output])
    assert stopped.value.code == 2
    assert f"argument --output: must be a folder for several meshes, got '{output}'" in capsys.readouterr().err


def test_an_output_folder_that_cannot_be_made_is_one_line(folder, capsys):
    Path("file").touch()
    for output in ("gone/deep", "file/"):
        assert main(["segment", "meshes", "--output", output]) == 2
        assert re.fullmatch(r"heatwalk: error: [^\n]+: cannot be written: [^\n]+\n", capsys.readouterr().err)


def test_inspect_reports_on_each_and_says_how_many_can_be_segmented(folder, capsys):
    Path("meshes/b.off").write_bytes(b"nothing")
    assert main(["inspect", "meshes"]) == 2
    printed = capsys.readouterr()
    assert printed.out.count("can be segmented       yes") == 3
    assert printed.out.endswith(f"\n4 meshes: 3 can be segmented, 1 failed: {Path('meshes', 'b.off')}\n")
    assert main(["inspect", "meshes/a.OFF", "meshes/c.ply"]) == 0


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_written_as_the_package_has_it_and_can_be_segmented(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    file = f"{name}{example_path(name).suffix}"
    for _ in range(2):
        assert main(["example", name]) == 0
    assert Path(file).read_bytes() == example_path(name).read_bytes()
    assert f"written: {file}\n" in capsys.readouterr().out
    mesh = read_mesh(file)
    assert heatwalk.inspect_mesh(mesh.vertices, mesh.faces).problem is None


def test_the_example_is_the_cow_and_other_files_are_not_overwritten(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["example"]) == 0
    assert Path("cow.obj").read_bytes() == bundled_path("cow").read_bytes()
    Path("cow.obj").write_text("mine")
    assert main(["example"]) == 2
    assert "cow.obj: exists with other contents" in capsys.readouterr().err
    assert Path("cow.obj").read_text() == "mine"
    assert main(["example", "--force"]) == 0
    Path("there").mkdir()
    for output, file in (("there", "there/cow.obj"), ("c.OBJ", "c.OBJ")):
        assert main(["example", "cow", "--output", output]) == 0
        assert Path(file).is_file()
    for arguments, message in (
        (["dog"], "there is no example 'dog'; there are cow, bunny, ant"),
        (["cow", "--output", "cow.off"], "cow.off: the mesh of 'cow' is a file .obj"),
        (["cow", "--output", "gone/cow.obj"], "cow.obj: cannot be written: No such file or directory"),
    ):
        assert main(["example", *arguments]) == 2
        assert message in capsys.readouterr().err
