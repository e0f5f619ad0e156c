import bz2
import gzip
import lzma
import re
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heatwalk.io import read_mesh
from heatwalk.meshes import MeshError, check_mesh, inspect_mesh
from tests.helpers.mesh_files import (
    CUBE_QUADS,
    CUBE_VERTICES,
    FORMATS,
    OCTAHEDRON,
    TETRAHEDRON,
    every_format,
    is_mesh,
    off_bytes,
    read_bytes,
    stl_binary_bytes,
)
from tests.helpers.meshes import bundled_path


@every_format
@pytest.mark.parametrize("name", ["cow", "bunny", "ant", "airplane"])
def test_a_real_mesh_comes_back_unchanged_from_every_format(tmp_path, name, suffix, encode):
    original = read_mesh(bundled_path(name))
    again = read_bytes(tmp_path, encode(original.vertices, original.faces), suffix)
    if suffix != ".stl":
        assert is_mesh(again, original.vertices, original.faces)
        assert not [note for note in again.notes if "coincide" not in note]
    else:
        stored = np.float32 if encode is stl_binary_bytes else np.float64
        in_file = original.vertices.astype(stored).astype(float)
        assert np.array_equal(again.vertices[again.faces], in_file[original.faces])
        assert len(again.vertices) == len(np.unique(in_file, axis=0))


@pytest.mark.parametrize("fmt", ["off", "obj", "ply ascii"])
def test_polygons_of_several_kinds_are_triangulated_in_the_order_of_trimesh_with_a_note(tmp_path, fmt):
    suffix, encode = FORMATS[fmt]
    pentagon, triangles = [0, 1, 5, 7, 4], [[0, 1, 2], [1, 3, 7]]
    polygons = [triangles[0], *CUBE_QUADS[:2], pentagon, triangles[1], [6, 2]]
    mesh = read_bytes(tmp_path, encode(CUBE_VERTICES, polygons), suffix)
    halves = [[0, 2, 3], [4, 5, 7], [3, 1, 0], [7, 6, 4]]
    fan = [[0, 1, 5], [0, 5, 7], [0, 7, 4]]
    assert is_mesh(mesh, CUBE_VERTICES, triangles + halves + fan)
    assert mesh.notes == ("triangulated 6 faces into 9 triangles",)


@pytest.mark.parametrize("fmt", [name for name in FORMATS if "stl" not in name])
def test_a_cube_of_quads_becomes_a_closed_surface_of_the_same_area(tmp_path, fmt):
    suffix, encode = FORMATS[fmt]
    mesh = read_bytes(tmp_path, encode(CUBE_VERTICES, CUBE_QUADS), suffix)
    report = inspect_mesh(mesh.vertices, mesh.faces)
    assert (report.n_faces, report.is_watertight, report.is_consistently_oriented) == (12, True, True)
    assert report.area == pytest.approx(6)
    assert mesh.notes == ("triangulated 6 faces into 12 triangles",)


def test_vertices_without_faces_are_dropped_with_a_note_and_the_others_keep_their_order(tmp_path):
    vertices, faces = TETRAHEDRON
    spread = np.insert(vertices, [0, 2, 4], np.nan, axis=0)
    mesh = read_bytes(tmp_path, off_bytes(spread, np.array([1, 2, 4, 5])[faces]), ".off")
    assert is_mesh(mesh, vertices, faces)
    assert mesh.notes == ("dropped 3 vertices that belong to no face",)


def test_suffixes_in_upper_case_and_paths_as_strings_are_accepted(tmp_path):
    (tmp_path / "A.OFF").write_bytes(off_bytes(*TETRAHEDRON))
    assert is_mesh(read_mesh(str(tmp_path / "A.OFF")), *TETRAHEDRON)


COMPRESSIONS = {".gz": gzip.compress, ".bz2": bz2.compress, ".xz": lzma.compress}


@every_format
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_compressed_file_is_read_as_what_it_contains(tmp_path, suffix, encode, compression):
    data = encode(*TETRAHEDRON)
    plain = read_bytes(tmp_path, data, suffix)
    for name in (suffix + compression, (suffix + compression).upper()):
        mesh = read_bytes(tmp_path, COMPRESSIONS[compression](data), name)
        assert is_mesh(mesh, plain.vertices, plain.faces)
        assert mesh.notes == plain.notes


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_damaged_compressed_file_is_an_error_that_says_so(tmp_path, compression):
    data = COMPRESSIONS[compression](off_bytes(*TETRAHEDRON))
    for broken in (data[: len(data) // 2], b"OFF" + data[3:], data[:-9]):
        with pytest.raises(MeshError, match=f"cannot be decompressed as {re.escape(compression)}, or is truncated: "):
            read_bytes(tmp_path, broken, f".off{compression}")
    for empty in (b"", COMPRESSIONS[compression](b"")):
        with pytest.raises(MeshError, match="the file is empty"):
            read_bytes(tmp_path, empty, f".off{compression}")


@pytest.mark.parametrize("name", ["cat.dae", "cat.off.zip", "cat.gz", "cat", "off.gz", "cat.off.gz.gz", ".off"])
def test_another_suffix_is_refused_with_those_that_can_be_read(tmp_path, name):
    (tmp_path / name).write_bytes(off_bytes(*TETRAHEDRON))
    message = r"unknown suffix '.*'; supported: \.off, \.obj, .*, \.msh, each also with \.gz, \.bz2, \.xz after it"
    with pytest.raises(MeshError, match=message):
        read_mesh(tmp_path / name)


@every_format
def test_a_file_cut_at_any_byte_is_an_error_or_still_the_whole_mesh(tmp_path, suffix, encode):
    data = encode(*TETRAHEDRON)
    whole = read_bytes(tmp_path, data, suffix)
    n_read = 0
    for length in range(len(data)):
        try:
            mesh = read_bytes(tmp_path, data[:length], suffix)
        except MeshError:
            continue
        n_read += 1
        if suffix == ".obj":  # declares no counts: the part before the cut is a valid file
            triangles = whole.vertices[whole.faces][: len(mesh.faces)]
            assert np.array_equal(mesh.vertices[mesh.faces], triangles)
        else:
            assert is_mesh(mesh, whole.vertices, whole.faces)
            assert length >= len(data.rstrip()) - len("thing") - 1  # the name after endsolid may be cut
    assert (n_read == 0) == (not data.endswith(b"\n"))  # nothing of a binary file can be spared


@every_format
def test_the_arrays_of_a_large_mesh_can_be_written_to(tmp_path, suffix, encode):
    mesh = read_mesh(bundled_path("bunny"))
    read = read_bytes(tmp_path, encode(mesh.vertices, mesh.faces.tolist()), suffix)
    for array in (read.vertices, read.faces):
        assert array.flags.writeable
        assert array.flags.c_contiguous


@every_format
def test_a_real_mesh_cut_anywhere_is_an_error(tmp_path, suffix, encode):
    mesh = read_mesh(bundled_path("cow"))
    data = encode(mesh.vertices, mesh.faces.tolist())
    # In an OBJ file a cut among the faces shows only where it leaves a line short.
    end = data.index(b"\nf ") if suffix == ".obj" else len(data) - 40
    for length in np.linspace(1, end, 12).astype(int):
        with pytest.raises(MeshError, match=re.escape(str(tmp_path / f"mesh{suffix}"))):
            read_bytes(tmp_path, data[:length], suffix)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


def read_or_mesh_error(folder, data, suffix):
    message = ""
    try:
        mesh = read_bytes(folder, data, suffix)
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
def test_a_file_with_changed_bytes_is_read_or_rejected_with_one_line(folder, suffix, encode, mutations):
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
def test_random_bytes_are_read_or_rejected_with_one_line(folder, suffix, beginning, data):
    read_or_mesh_error(folder, beginning + data, suffix)


def test_a_text_file_cut_within_its_last_quad_is_rejected(tmp_path):
    for fmt in ("off", "ply ascii"):
        suffix, encode = FORMATS[fmt]
        with pytest.raises(MeshError, match="declares 6 faces but contains 5: the file is truncated"):
            read_bytes(tmp_path, encode(CUBE_VERTICES, CUBE_QUADS).removesuffix(b" 5\n"), suffix)
