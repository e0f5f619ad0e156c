import re

import pytest
import trimesh

from heatwalk.io import read_mesh
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
