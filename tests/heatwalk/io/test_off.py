import re

import pytest
import trimesh

from heatwalk.io import read_mesh
from heatwalk.meshes import MeshError
from tests.helpers.mesh_files import TETRAHEDRON, is_mesh, read_bytes

TETRAHEDRON_ROWS = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"

OFF_LAYOUTS = {
    "plain": "OFF\n4 4 6\n" + TETRAHEDRON_ROWS,
    "no edge count": "OFF\n4 4\n" + TETRAHEDRON_ROWS,
    "counts next to the keyword": "OFF 4 4 0\n" + TETRAHEDRON_ROWS,
    "counts glued to the keyword": "OFF4 4 0\n" + TETRAHEDRON_ROWS,
    "carriage returns": ("OFF\n4 4 0\n" + TETRAHEDRON_ROWS).replace("\n", "\r\n"),
    "old Macintosh line ends": ("OFF\n4 4 0\n" + TETRAHEDRON_ROWS).replace("\n", "\r"),
    "no newline at the end": ("OFF\n4 4 0\n" + TETRAHEDRON_ROWS).rstrip(),
    "byte order mark": "\ufeffOFF\n4 4 0\n" + TETRAHEDRON_ROWS,
    "comments and blank lines": "# made by é\n\nOFF # keyword\n# counts\n4 4 0 # here\n\n"
    + TETRAHEDRON_ROWS.replace("\n", " # row\n\n#\n"),
    "colours of vertices": "COFF\n4 4 0\n"
    + re.sub(r"^(\d \d \d)$", r"\1 .5 .5 .5 1", TETRAHEDRON_ROWS, flags=re.MULTILINE),
    "colours of some faces": "OFF\n4 4 0\n" + TETRAHEDRON_ROWS.replace("3 1 2 3\n", "3 1 2 3  255 0 0.5\n"),
    "tabs and indents": ("OFF\n4 4 0\n" + TETRAHEDRON_ROWS).replace(" ", "\t").replace("\n", "\n  "),
    "more after the faces": "OFF\n4 4 0\n" + TETRAHEDRON_ROWS + "2 0 1\nwhatever\n",
    "all on one line": "OFF 4 4 6 " + TETRAHEDRON_ROWS.replace("\n", " "),
    "vertices on one line, faces on another": "OFF\n4 4 6\n"
    + TETRAHEDRON_ROWS.replace("\n", " ").replace(" 3 0 2 1", "\n3 0 2 1"),
    "two rows per line": "OFF\n4 4 6\n" + re.sub("\n([^\n]*\n)", r" \1", TETRAHEDRON_ROWS),
    "one number per line": "OFF\n4\n4\n6\n" + TETRAHEDRON_ROWS.replace(" ", "\n"),
    "counts on lines of their own": "OFF\n4\n4\n0\n" + TETRAHEDRON_ROWS,
    "two counts on lines of their own": "OFF\n4\n4\n" + TETRAHEDRON_ROWS,
    "the number of edges on a line of its own": "OFF 4 4\n0\n" + TETRAHEDRON_ROWS,
    "wrapped faces": "OFF\n4 4 0\n" + TETRAHEDRON_ROWS.replace("3 0 1 3", "3 0\n1 3").replace("3 0 3 2", "3\n0\n3 2"),
    "wrapped faces with colours": "OFF\n4 4 0\n" + TETRAHEDRON_ROWS.replace("3 0 1 3", "3 0\n1 3 255 0 0"),
    "lower case": "off\n4 4 0\n" + TETRAHEDRON_ROWS,
    "lower case with colours": "coff\n4 4 0\n"
    + re.sub(r"^(\d \d \d)$", r"\1 9 9 9 255", TETRAHEDRON_ROWS, flags=re.MULTILINE),
    "no keyword": "4 4 6\n" + TETRAHEDRON_ROWS,
    "no keyword, after a comment": "# made by x\n4 4\n" + TETRAHEDRON_ROWS,
    "four coordinates": "4OFF\n4 4 0\n" + re.sub(r"^(\d \d \d)$", r"\1 1", TETRAHEDRON_ROWS, flags=re.MULTILINE),
    "three dimensions": "nOFF\n3\n4 4 0\n" + TETRAHEDRON_ROWS,
    "three dimensions beside the keyword": "nOFF 3\n4 4 0\n" + TETRAHEDRON_ROWS,
    "normals": "NOFF\n4 4 0\n" + re.sub(r"^(\d \d \d)$", r"\1 0 0 1", TETRAHEDRON_ROWS, flags=re.MULTILINE),
    "colours, all on one line": "COFF 4 4 0 "
    + re.sub(r"^(\d \d \d)$", r"\1 9 9 9 255", TETRAHEDRON_ROWS, flags=re.MULTILINE).replace("\n", " "),
    "trailing byte": "OFF\n4 4 0\n" + TETRAHEDRON_ROWS + "\x1a",
}


@pytest.mark.parametrize("text", OFF_LAYOUTS.values(), ids=OFF_LAYOUTS)
def test_off_files_are_read_however_they_are_laid_out(tmp_path, text):
    assert is_mesh(read_bytes(tmp_path, text.encode(), ".off"), *TETRAHEDRON)


@pytest.mark.parametrize("model", [1, 81, 170, 246, 285, 381])
def test_benchmark_meshes_are_read_as_trimesh_reads_them(psb_root, model):
    path = psb_root / f"data/off/{model}.off"
    mesh, reference = read_mesh(path), trimesh.load(path, process=False)
    assert is_mesh(mesh, reference.vertices, reference.faces)
    assert mesh.notes == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "OFF\n4 4 0\n" + TETRAHEDRON_ROWS.replace("0 0 1\n", "0 1\n"),
            r"line 6: vertex 3 \(counted from 0\) has 2 coord.*",
        ),
        (
            "OFF\n4 4 0\n" + TETRAHEDRON_ROWS.replace("3 1 2 3", "4 1 2 3"),
            r"line 9: face 2 \(.*\) declares 4 corners but has 3",
        ),
        (
            "OFF\n4 4 0\n" + TETRAHEDRON_ROWS.replace("3 1 2 3", "3 1 2 9"),
            r"face 2 \(.*\) refers to vertex 9, but .* 4 vertices",
        ),
        ("OFF\n4 4 0\n" + TETRAHEDRON_ROWS.replace("3 1 2 3", "-3 1 2 3"), r"line 9: face 2 \(.*\) has '-3' corners"),
        (
            "OFF\n4 4 0\n" + TETRAHEDRON_ROWS.replace("3 1 2 3", "3 1 2 .5"),
            r"line 9: face 2 \(.*\) has a corner that is .*",
        ),
        ("OFF\n4 4 0\n" + TETRAHEDRON_ROWS.replace("3 1 2 3", "3 1 2 x"), "line 9: 'x' is not a number"),
        ("OFF\n4 5 0\n" + TETRAHEDRON_ROWS, "declares 5 faces but contains 4: the file is truncated"),
        ("nOFF 2\n4 4 0\n" + TETRAHEDRON_ROWS, r"the vertices have 2 coordinates \(nOFF 2\); three are required"),
        ("nOFF\n", "the keyword nOFF is not followed by the dimension, .*"),
        (
            "4OFF\n4 4 0\n" + re.sub(r"^(\d \d \d)$", r"\1 2", TETRAHEDRON_ROWS, flags=re.MULTILINE),
            r"vertex 0 \(counted from 0\) has the fourth coordinate 2: 4OFF is read only if it is 1 everywhere; .*",
        ),
    ],
)
def test_a_broken_off_file_is_rejected_with_what_is_wrong_and_where(tmp_path, text, message):
    with pytest.raises(MeshError, match=f"mesh.off: {message}$"):
        read_bytes(tmp_path, text.encode(), ".off")
