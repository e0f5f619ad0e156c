import re
import warnings

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from heatwalk.io import label_colours, read_mesh, read_seg, write_ply, write_seg
from heatwalk.meshes import MeshError, check_mesh, inspect_mesh
from tests.helpers.meshes import bundled_path

OCTAHEDRON = trimesh.convex.convex_hull(np.vstack([np.eye(3), -np.eye(3)]))
TETRAHEDRON = (
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)
CUBE_QUADS = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
CUBE_VERTICES = np.array([[x, y, z] for z in (0.0, 1) for y in (0.0, 1) for x in (0.0, 1)])


# The formats written out plainly, independently of the code under test; text with all digits of a double.


def off_bytes(vertices, faces):
    rows = [" ".join(map(repr, row)) for row in np.asarray(vertices).tolist()]
    rows += [f"{len(face)} {' '.join(map(str, face))}" for face in faces]
    return f"OFF\n{len(vertices)} {len(faces)} 0\n{chr(10).join(rows)}\n".encode()


def obj_bytes(vertices, faces):
    rows = ["v " + " ".join(map(repr, row)) for row in np.asarray(vertices).tolist()]
    rows += ["f " + " ".join(str(corner + 1) for corner in face) for face in faces]
    return ("\n".join(rows) + "\n").encode()


def ply_bytes(vertices, faces, form):
    header = (
        f"ply\nformat {form} 1.0\ncomment made by a test\nelement vertex {len(vertices)}\nproperty double x\n"
        f"property double y\nproperty double z\nelement face {len(faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode()
    if form == "ascii":
        return header + off_bytes(vertices, faces).split(b"\n", 2)[2]
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}[form]
    rows = [bytes([len(face)]) + np.array(face, dtype=order + "i4").tobytes() for face in faces]
    return header + np.asarray(vertices).astype(order + "f8").tobytes() + b"".join(rows)


def stl_text_bytes(vertices, faces):
    facets = [
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {x!r} {y!r} {z!r}\n" for x, y, z in np.asarray(vertices)[face].tolist())
        + " endloop\nendfacet\n"
        for face in faces
    ]
    return f"solid thing\n{''.join(facets)}endsolid thing\n".encode()


def stl_binary_bytes(vertices, faces):
    record = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    record["corners"] = np.asarray(vertices)[np.asarray(faces)]
    return b"solid misleading".ljust(80) + np.uint32(len(faces)).tobytes() + record.tobytes()


FORMATS = {
    "off": (".off", off_bytes),
    "obj": (".obj", obj_bytes),
    "ply ascii": (".ply", lambda v, f: ply_bytes(v, f, "ascii")),
    "ply little endian": (".ply", lambda v, f: ply_bytes(v, f, "binary_little_endian")),
    "ply big endian": (".ply", lambda v, f: ply_bytes(v, f, "binary_big_endian")),
    "stl ascii": (".stl", stl_text_bytes),
    "stl binary": (".stl", stl_binary_bytes),
}
every_format = pytest.mark.parametrize(("suffix", "encode"), FORMATS.values(), ids=FORMATS)


def read(tmp_path, data, suffix):
    path = tmp_path / f"mesh{suffix}"
    path.write_bytes(data)
    return read_mesh(path)


def same(mesh, vertices, faces):
    return np.array_equal(mesh.vertices, vertices) and np.array_equal(mesh.faces, faces)


# --- reading


@every_format
@pytest.mark.parametrize("name", ["cow", "bunny", "ant", "airplane"])
def test_a_real_mesh_comes_back_unchanged_from_every_format(tmp_path, name, suffix, encode):
    original = read_mesh(bundled_path(name))
    again = read(tmp_path, encode(original.vertices, original.faces), suffix)
    if suffix != ".stl":
        assert same(again, original.vertices, original.faces)
        assert again.notes == ()
    else:
        stored = np.float32 if encode is stl_binary_bytes else np.float64
        in_file = original.vertices.astype(stored).astype(float)
        assert np.array_equal(again.vertices[again.faces], in_file[original.faces])
        assert len(again.vertices) == len(np.unique(in_file, axis=0))


@pytest.mark.parametrize("model", [1, 81, 170, 246, 285, 381])
def test_benchmark_meshes_are_read_as_trimesh_reads_them(psb_root, model):
    path = psb_root / f"data/off/{model}.off"
    mesh, reference = read_mesh(path), trimesh.load(path, process=False)
    assert same(mesh, reference.vertices, reference.faces)
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


@pytest.mark.parametrize("name", ["bone", "ant", "airplane"])
def test_ply_files_keep_the_order_of_their_vertices_and_faces(name):
    pymeshlab = pytest.importorskip("pymeshlab")
    mesh = read_mesh(bundled_path(name))
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(bundled_path(name)))
    reference = meshes.current_mesh()
    used = np.unique(reference.face_matrix())
    assert np.array_equal(mesh.vertices, reference.vertex_matrix().astype(np.float32)[used])
    assert np.array_equal(used[mesh.faces], reference.face_matrix())
    n_unused = reference.vertex_number() - len(used)
    assert mesh.notes == ((f"dropped {n_unused} vertices that belong to no face",) if n_unused else ())


TETRAHEDRON_ROWS = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"


OFF_LAYOUTS = {
    "plain": "OFF\n4 4 6\n" + TETRAHEDRON_ROWS,
    "no edge count": "OFF\n4 4\n" + TETRAHEDRON_ROWS,
    "counts beside the keyword": "OFF 4 4 0\n" + TETRAHEDRON_ROWS,
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
    assert same(read(tmp_path, text.encode(), ".off"), *TETRAHEDRON)


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
    "continued lines and comments": "# c\n" + OBJ_VERTICES + "f 1 \\\n3 2 # c\r\nf 1 2 \\\r\n 4\nf 2 3 4\nf 1 4 3",
}


@pytest.mark.parametrize("text", OBJ_LAYOUTS.values(), ids=OBJ_LAYOUTS)
def test_obj_files_are_read_however_they_are_laid_out(tmp_path, text):
    mesh = read(tmp_path, text.encode(), ".obj")
    assert same(mesh, *TETRAHEDRON)
    assert mesh.notes == ()


@pytest.mark.parametrize("fmt", ["off", "obj", "ply ascii"])
def test_polygons_of_several_kinds_are_split_in_the_order_of_trimesh_and_said_to_be(tmp_path, fmt):
    suffix, encode = FORMATS[fmt]
    pentagon, triangles = [0, 1, 5, 7, 4], [[0, 1, 2], [1, 3, 7]]
    polygons = [triangles[0], *CUBE_QUADS[:2], pentagon, triangles[1], [6, 2]]
    mesh = read(tmp_path, encode(CUBE_VERTICES, polygons), suffix)
    halves = [[0, 2, 3], [4, 5, 7], [3, 1, 0], [7, 6, 4]]
    fan = [[0, 1, 5], [0, 5, 7], [0, 7, 4]]
    assert same(mesh, CUBE_VERTICES, triangles + halves + fan)
    assert mesh.notes == ("6 faces, not all of them triangles, became 9 triangles",)


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian"])
def test_a_binary_ply_file_with_faces_of_several_sizes_is_refused(tmp_path, form):
    for polygons in ([[0, 1, 2], *CUBE_QUADS], [*CUBE_QUADS, [0, 1, 2]]):
        with pytest.raises(MeshError, match="PLY is unexpected length"):
            read(tmp_path, ply_bytes(CUBE_VERTICES, polygons, form), ".ply")


@pytest.mark.parametrize("fmt", [name for name in FORMATS if "stl" not in name])
def test_a_cube_of_quads_becomes_a_closed_surface_of_the_same_area(tmp_path, fmt):
    suffix, encode = FORMATS[fmt]
    mesh = read(tmp_path, encode(CUBE_VERTICES, CUBE_QUADS), suffix)
    report = inspect_mesh(mesh.vertices, mesh.faces)
    assert (report.n_faces, report.is_watertight, report.is_consistently_oriented) == (12, True, True)
    assert report.area == pytest.approx(6)
    assert mesh.notes == ("6 faces, not all of them triangles, became 12 triangles",)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_properties_and_elements_that_are_not_wanted_are_passed_over(tmp_path, form):
    header = (
        f"ply\r\nformat {form} 1.0\r\nobj_info x\r\nelement camera 2\r\nproperty list ushort short sizes\r\n"
        "property float f\r\nelement vertex 4\r\nproperty uchar red\r\nproperty float z\r\n"
        "property double y\r\n"
        "property float x\r\nelement face 4\r\nproperty int flags\r\nproperty list int uint vertex_index\r\n"
        "property list uchar float texcoord\r\nproperty uchar quality\r\nelement edge 1\r\nproperty int vertex1\r\n"
        "property int vertex2\r\n"
        "end_header\r\n"
    ).encode()
    order = ">" if "big" in form else "<"
    body, rows = b"", []

    def put(*typed):
        nonlocal body
        body += b"".join(np.array(value, dtype=order + kind).tobytes() for kind, value in typed)
        rows.append(" ".join(str(value) for _, value in typed))

    put(("u2", 2), ("i2", 7), ("i2", 8), ("f4", 0.5))
    put(("u2", 2), ("i2", 8), ("i2", 9), ("f4", 0.5))
    for x, y, z in TETRAHEDRON[0].tolist():
        put(("u1", 200), ("f4", z), ("f8", y), ("f4", x))
    for i, face in enumerate(TETRAHEDRON[1].tolist()):
        seam = [("f4", 0.25 * (i + corner)) for corner in range(6)]
        put(("i4", 5), ("i4", 3), *(("u4", c) for c in face), ("u1", 6), *seam, ("u1", 9))
    put(("i4", 0), ("i4", 1))
    mesh = read(tmp_path, header + ("\r\n".join(rows).encode() if form == "ascii" else body), ".ply")
    assert same(mesh, *TETRAHEDRON)


def test_stl_corners_of_equal_coordinates_become_one_vertex(tmp_path):
    vertices, faces = TETRAHEDRON
    text = stl_text_bytes(vertices * 1e-30, faces).replace(b"vertex 0.0", b"VERTEX -0.0")
    mesh = read(tmp_path, text, ".STL")
    assert np.array_equal(mesh.vertices, vertices[[0, 3, 2, 1]] * 1e-30)
    assert np.array_equal(mesh.faces, np.array([0, 3, 2, 1])[faces])
    assert mesh.notes == ("merged 12 duplicated STL vertices into 4",)


def test_several_solids_of_an_stl_file_are_one_mesh(tmp_path):
    vertices, faces = TETRAHEDRON
    halves = stl_text_bytes(vertices, faces[:2]) + stl_text_bytes(vertices, faces[2:])
    assert same(read(tmp_path, halves, ".stl"), vertices[[0, 3, 2, 1]], np.array([0, 3, 2, 1])[faces])
    with pytest.raises(MeshError, match="declares 4 faces and holds 2: the file is cut short"):
        read(tmp_path, halves[:-20], ".stl")


def test_vertices_without_faces_are_dropped_and_said_to_be_while_the_others_keep_their_order(tmp_path):
    vertices, faces = TETRAHEDRON
    spread = np.insert(vertices, [0, 2, 4], np.nan, axis=0)
    mesh = read(tmp_path, off_bytes(spread, np.array([1, 2, 4, 5])[faces]), ".off")
    assert same(mesh, vertices, faces)
    assert mesh.notes == ("dropped 3 vertices that belong to no face",)


def test_suffixes_are_known_in_capitals_and_by_string(tmp_path):
    (tmp_path / "A.OFF").write_bytes(off_bytes(*TETRAHEDRON))
    assert same(read_mesh(str(tmp_path / "A.OFF")), *TETRAHEDRON)


# --- broken files


@every_format
def test_a_file_cut_at_any_byte_is_an_error_or_still_the_whole_mesh(tmp_path, suffix, encode):
    data = encode(*TETRAHEDRON)
    whole = read(tmp_path, data, suffix)
    n_read = 0
    for length in range(len(data)):
        try:
            mesh = read(tmp_path, data[:length], suffix)
        except MeshError:
            continue
        n_read += 1
        if suffix == ".obj":  # declares no counts: what comes before the cut is a file of its own
            triangles = whole.vertices[whole.faces][: len(mesh.faces)]
            assert np.array_equal(mesh.vertices[mesh.faces], triangles)
        else:
            assert same(mesh, whole.vertices, whole.faces)
            assert length >= len(data.rstrip()) - len("thing") - 1  # the name after endsolid may be cut
    assert (n_read == 0) == (not data.endswith(b"\n"))  # nothing of a binary file can be spared


@every_format
def test_a_real_mesh_cut_anywhere_is_an_error(tmp_path, suffix, encode):
    mesh = read_mesh(bundled_path("cow"))
    data = encode(mesh.vertices, mesh.faces.tolist())
    # In an OBJ file a cut among the faces shows only where it leaves a line short.
    end = data.index(b"\nf ") if suffix == ".obj" else len(data) - 40
    for length in np.linspace(1, end, 12).astype(int):
        with pytest.raises(MeshError, match=re.escape(str(tmp_path / f"mesh{suffix}"))):
            read(tmp_path, data[:length], suffix)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


def read_or_mesh_error(folder, data, suffix):
    message = ""
    try:
        mesh = read(folder, data, suffix)
        assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float64, np.int64)
        assert np.array_equal(np.unique(mesh.faces), np.arange(len(mesh.vertices)))
        check_mesh(mesh.vertices, mesh.faces)
    except MeshError as error:
        message = str(error)
    assert message.isprintable()


mutation = st.tuples(
    st.floats(0, 1),
    st.integers(0, 12),
    st.one_of(
        st.binary(max_size=6),
        st.sampled_from([b"-1", b"99999999999999999999", b"nan", b"1e999", b" ", b"\n", b"0", b"4294967295", b"#"]),
    ),
)


@every_format
@settings(max_examples=100, deadline=None)
@given(mutations=st.lists(mutation, min_size=1, max_size=4))
def test_a_file_with_changed_bytes_is_read_or_refused_with_one_line(folder, suffix, encode, mutations):
    data = encode(OCTAHEDRON.vertices, OCTAHEDRON.faces.tolist())
    for where, n_removed, inserted in mutations:
        at = int(where * len(data))
        data = data[:at] + inserted + data[at + n_removed :]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_or_mesh_error(folder, data, suffix)


@pytest.mark.parametrize("beginning", [b"", b"OFF\n", b"v ", b"solid facet", b"ply\nformat ascii 1.0\n"])
@pytest.mark.parametrize("suffix", [".off", ".obj", ".ply", ".stl"])
@settings(max_examples=30, deadline=None)
@given(data=st.binary(max_size=300))
def test_random_bytes_are_read_or_refused_with_one_line(folder, suffix, beginning, data):
    read_or_mesh_error(folder, beginning + data, suffix)


def test_a_text_file_cut_within_its_last_quad_is_refused(tmp_path):
    for fmt in ("off", "ply ascii"):
        suffix, encode = FORMATS[fmt]
        with pytest.raises(MeshError, match="declares 6 faces and holds 5: the file is cut short"):
            read(tmp_path, encode(CUBE_VERTICES, CUBE_QUADS).removesuffix(b" 5\n"), suffix)


def test_the_last_face_of_a_ply_file_is_whole_only_with_all_its_properties(tmp_path):
    header = ply_bytes(*TETRAHEDRON, "ascii").replace(b"property list", b"property int flags\nproperty list")
    data = re.sub(rb"^3 ", b"7 3 ", header, flags=re.MULTILINE)
    assert same(read(tmp_path, data, ".ply"), *TETRAHEDRON)
    for cut in (b"2\n", b"3 2\n", b"0 3 2\n", b"3 0 3 2\n"):
        with pytest.raises(MeshError, match="declares 4 faces and holds 3: the file is cut short"):
            read(tmp_path, data.removesuffix(cut), ".ply")


# --- writing


def test_a_written_ply_gives_back_the_mesh_in_single_precision_and_the_colours_of_its_labels(tmp_path):
    cow = read_mesh(bundled_path("cow"))
    labels = np.arange(len(cow.vertices)) % 7
    for dissipator in (6, None):
        write_ply(tmp_path / "cow.ply", cow.vertices, cow.faces, labels, dissipator)
        assert same(read_mesh(tmp_path / "cow.ply"), cow.vertices.astype(np.float32), cow.faces)
        coloured = trimesh.load(tmp_path / "cow.ply", process=False)
        assert np.array_equal(coloured.visual.vertex_colors, label_colours(labels, dissipator))


@pytest.mark.parametrize("scale", [1e-50, 1e50])
def test_a_mesh_that_single_precision_cannot_hold_is_not_written(tmp_path, scale):
    with pytest.raises(OSError, match="outside the range of single precision"):
        write_ply(tmp_path / "a.ply", TETRAHEDRON[0] * scale, TETRAHEDRON[1], np.zeros(4, dtype=int))
    assert not (tmp_path / "a.ply").exists()


def test_labels_have_colours_of_their_own_that_do_not_depend_on_the_other_labels():
    colours = label_colours(np.arange(60))
    assert len(np.unique(colours, axis=0)) == 60
    assert np.array_equal(label_colours(np.array([7, 3, 7])), colours[[7, 3, 7]])
    assert (colours[:, 3] == 255).all()


def test_the_dissipator_region_alone_is_grey():
    colours = label_colours(np.arange(61), dissipator=20)
    is_grey = (colours[:, :3] == colours[:, :1]).all(axis=1)
    assert np.flatnonzero(is_grey).tolist() == [20]


def test_the_first_twenty_colours_are_well_apart_from_each_other_and_from_grey():
    colours = np.vstack([label_colours(np.arange(20)), label_colours(np.array([0]), dissipator=0)])[:, :3] / 255.0
    linear = np.where(colours > 0.04045, ((colours + 0.055) / 1.055) ** 2.4, colours / 12.92)
    xyz = linear @ np.array([[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]])
    f = np.cbrt(xyz / [0.9505, 1.0, 1.089])  # every colour but the darkest lies in the cubic part of CIE L*a*b*
    lab = np.column_stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])])
    distance = np.linalg.norm(lab[:, None] - lab[None], axis=2)
    assert distance[np.triu_indices(len(lab), 1)].min() > 15  # about 2.3 is just noticeable


def test_seg_files_give_back_their_labels(tmp_path):
    labels = np.array([3, 0, 0, 12, 1])
    write_seg(tmp_path / "a.seg", labels)
    assert (tmp_path / "a.seg").read_text() == "3\n0\n0\n12\n1\n"
    assert np.array_equal(read_seg(tmp_path / "a.seg"), labels)
    assert read_seg(tmp_path / "a.seg").dtype == np.int64


def test_benchmark_segmentations_have_a_label_for_every_face_of_their_mesh(psb_root):
    off = sorted((psb_root / "data/off").glob("*.off"))[0]
    n_faces = len(read_mesh(off).faces)
    segmentations = sorted((psb_root / "data/seg/Benchmark" / off.stem).glob("*.seg"))
    assert segmentations
    for path in segmentations:
        assert np.array_equal(read_seg(path), np.loadtxt(path, dtype=int))
        assert len(read_seg(path)) == n_faces


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("0\n1\ntwo\n3\n", "line 3 is not a label (0, 1, 2 …): 'two'"),
        ("0\n-1\n", "line 2 is not a label (0, 1, 2 …): '-1'"),
        ("0\n\n1\n", "line 2 is not a label (0, 1, 2 …): ''"),
        ("0\n1 2\n", "line 2 is not a label (0, 1, 2 …): '1 2'"),
        ("0.5\n", "line 1 is not a label (0, 1, 2 …): '0.5'"),
        ("0\n99999999999999999999\n", "line 2 is not a label (0, 1, 2 …): '99999999999999999999'"),
    ],
)
def test_a_broken_seg_file_is_refused_with_the_number_of_the_line(tmp_path, text, message):
    path = tmp_path / "a.seg"
    path.write_text(text)
    with pytest.raises(MeshError, match=re.escape(f"{path}: {message}") + "$"):
        read_seg(path)


def test_a_missing_seg_file_is_refused(tmp_path):
    with pytest.raises(MeshError, match="No such file"):
        read_seg(tmp_path / "a.seg")
