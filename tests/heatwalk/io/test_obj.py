import re

import numpy as np
import pytest

from heatwalk.io import read_mesh
from heatwalk.meshes import MeshError
from tests.helpers.mesh_files import TETRAHEDRON, is_mesh, read_bytes
from tests.helpers.meshes import bundled_path

OBJ_VERTICES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"


OBJ_FACES = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


OBJ_LAYOUTS = {
    "plain": OBJ_VERTICES + OBJ_FACES,
    "textures and normals": OBJ_VERTICES + "vt 0 0\nvt 1 0\nvt .5 .5\nvn 0 0 1\n"
    "f 1/1/1 3/2/1 2/3/1\nf 1/3 2/2 4/1\nf 2//1 3//1 4//1\nf 1 4 3\n",
    "counted from the end": OBJ_VERTICES + "f -4 -2 -3\nf -4 -3 -1\nf 2 3 4\nf -4/-1/-1 4 -2\n",
    "counted from the end so far": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -1 -2\nv 0 0 1\nf -4 -3 -1\nf 2 3 4\nf 1 4 3\n",
    "objects, groups, materials": "mtllib gone.mtl\no one\n" + OBJ_VERTICES + "g a\nusemtl red\nf 1 3 2\n"
    "f 1 2 4\no two\ng b\nusemtl blue\ns off\nf 2 3 4\nl 1 2\nusemtl red\nf 1 4 3\n",
    "colours and weights": OBJ_VERTICES.replace("\n", " 1 .5 .5\n") + OBJ_FACES,
    "backslashes at the end of comments": "# a\\\n" + OBJ_VERTICES + OBJ_FACES.replace("f 1 2 4\n", "f 1 2 4 # b\\\n"),
    "backslashes at the end of names": "mtllib a\\\n"
    + OBJ_VERTICES
    + "g a\\\nf 1 3 2\nusemtl c:\\b\\\nf 1 2 4\no d \\ \n"
    "f 2 3 4\ng e\\\nf 1 4 3\n",
    "backslashes before blanks": "v 0 0 \\ \n0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf \\\t\n 1 \\  \r\n3 \\\n2\n"
    + OBJ_FACES[8:],
    "Unicode line separators in comments and names": "# x\u2028v 9 9 9\n# \u0085v 9 9 9\n"
    + OBJ_VERTICES
    + "g \u2029f 1 2 3\no \x0bf 1 2 3\nusemtl \x1cf 1 2 3\n"
    + OBJ_FACES,
    "old keyword of faces": OBJ_VERTICES + OBJ_FACES.replace("f ", "fo "),
    "byte-order mark": "\ufeff" + OBJ_VERTICES + OBJ_FACES,
    "old Macintosh line ends": (OBJ_VERTICES + OBJ_FACES).replace("\n", "\r"),
    "tabs and indents": (OBJ_VERTICES + OBJ_FACES).replace(" ", "\t").replace("\n", "\n \t"),
    "continued lines and comments": "# c\n" + OBJ_VERTICES + "f 1 \\\n3 2 # c\r\nf 1 2 \\\r\n 4\nf 2 3 4\nf 1 4 3",
}


@pytest.mark.parametrize("text", OBJ_LAYOUTS.values(), ids=OBJ_LAYOUTS)
def test_obj_files_are_read_however_they_are_laid_out(tmp_path, text):
    mesh = read_bytes(tmp_path, text.encode(), ".obj")
    assert is_mesh(mesh, *TETRAHEDRON)
    assert mesh.notes == ()


@pytest.mark.parametrize("name", ["cow", "bunny"])
def test_obj_files_are_read_as_meshlab_reads_them_without_splits_at_texture_seams(name):
    pymeshlab = pytest.importorskip("pymeshlab")
    path = bundled_path(name)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    reference = meshes.current_mesh()
    mesh = read_mesh(path)
    assert np.array_equal(mesh.faces, reference.face_matrix())
    assert np.allclose(mesh.vertices, reference.vertex_matrix(), rtol=1e-6, atol=0)
    assert len(mesh.vertices) == len(re.findall(r"^v ", path.read_text(), flags=re.MULTILINE))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v 0 0\n" + OBJ_FACES, "line 1: a vertex needs three coordinates, but has 2"),
        (OBJ_VERTICES + "v 0 0 y\n" + OBJ_FACES, "line 5: 'y' is not a coordinate"),
        (OBJ_VERTICES + "v 1v 0 0\n" + OBJ_FACES, "line 5: '1v' is not a coordinate"),
        (OBJ_VERTICES + "f 1 \\\n2 \\\n3\nf 1 2 x\n", "line 8: 'x' is not a corner of a face"),
        (OBJ_VERTICES + OBJ_FACES + "f 1/1 2/2 f/3\n", "line 9: 'f/3' is not a corner of a face"),
        (OBJ_VERTICES + OBJ_FACES + "f 1 2 2.5\n", "line 9: '2.5' is not a corner of a face"),
        (OBJ_VERTICES + OBJ_FACES + "f 1 2 0/1\n", "line 9: a face refers to vertex 0, but OBJ counts vertices from 1"),
        (
            OBJ_VERTICES + OBJ_FACES + "f 1 2 5\n",
            r"face 4 \(counted from 0\) refers to vertex 4, but there are 4 vertices",
        ),
        (
            OBJ_VERTICES + OBJ_FACES + "f 1 2 -5\n",
            r"face 4 \(counted from 0\) refers to vertex -1, but there are 4 vertices",
        ),
    ],
)
def test_a_broken_obj_file_is_rejected_with_what_is_wrong_and_where(tmp_path, text, message):
    with pytest.raises(MeshError, match=f"mesh.obj: {message}$"):
        read_bytes(tmp_path, text.encode(), ".obj")
