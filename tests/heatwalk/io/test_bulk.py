"""What is read in bulk is what the careful readers read, bit for bit, or left to them."""

import re
from unittest import mock

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from heatwalk.io import numbers, obj, off, stl, vtk_legacy
from heatwalk.io.polygons import Polygons
from heatwalk.meshes import MeshError
from heatwalk.numerics import rows as rows_module
from tests.helpers.mesh_files import CUBE_QUADS, CUBE_VERTICES, OCTAHEDRON, TETRAHEDRON, obj_bytes, stl_text_bytes


def is_same(a, b):
    """Whether two results are equal in every bit of every array."""
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(is_same, a, b))
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def or_none(read, *arguments):
    """What a reader returns; None if it rejects the file."""
    try:
        return read(*arguments)
    except MeshError:
        return None


real = st.floats(allow_nan=False)
spelled = st.one_of(
    st.builds(lambda x, form: form(x), real, st.sampled_from([repr, "{:.17g}".format, "{:e}".format, "{:.3f}".format])),
    st.integers(-(10**25), 10**25).map(str),
    st.builds(
        "{}{}.{}{}".format,
        st.sampled_from(["", "-", "+"]),
        st.text("0123456789", max_size=25),
        st.text("0123456789", max_size=25),
        st.sampled_from(["", "e5", "E-5", "e+30", "e-330", "e400", "e", "x"]),
    ),
    st.sampled_from(["nan", "NaN", "inf", "-inf", "Infinity", "-0", "-0.0", "0x10", "1_0", "1,2", "1;", '"1"', "4d3"]),
)
gap = st.text(" \t\n\r\v\f", min_size=1, max_size=3)


@settings(max_examples=150, deadline=None)
@given(words=st.lists(st.tuples(spelled, gap), min_size=1, max_size=8), before=st.sampled_from(["", " ", "\r\n"]))
def test_numbers_of_large_texts_are_those_that_python_reads_one_by_one(words, before):
    text = (before + "".join(word + space for word, space in words)).encode()
    bulk = numbers._parse_large(text)
    values, bad_word = numbers.parse_numbers(text)
    if bulk is not None:
        assert bad_word is None
        assert np.array_equal(bulk, values, equal_nan=True)
        assert np.array_equal(np.signbit(bulk), np.signbit(values)) or np.isnan(values).any()
        assert np.array_equal(bulk, [float(word) for word in text.split()], equal_nan=True)


def test_texts_of_plain_numbers_are_read_in_bulk_with_every_digit():
    rng = np.random.default_rng(0)
    doubles = rng.integers(0, 2**64, 4000, dtype=np.uint64).view(np.float64)
    doubles = doubles[np.isfinite(doubles) & (np.abs(doubles) > 1e-300)]
    for form in (repr, "{:.16e}".format, "{:.16E}".format):
        text = " ".join(map(form, doubles.tolist())).encode()
        assert is_same(numbers._parse_large(text), doubles)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(real, real, st.integers(-(2**63), 2**63 - 1)), min_size=1))
def test_rows_are_written_with_all_digits_of_their_numbers(rows):
    a, b, c = (np.array(column) for column in zip(*rows, strict=True))
    written = numbers.format_rows(["f", a, b, c])
    words = [line.split(b" ") for line in written.splitlines()]
    assert written.endswith(b"\n")
    assert [(b"f", *row) for row in rows] == [(w, float(x), float(y), int(z)) for w, x, y, z in words]


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("mixer", [rows_module._MIXER, np.uint64(0), np.uint64(1)])
def test_equal_rows_are_merged_as_by_unique_rows_whatever_the_mix_of_their_bits(kind, mixer):
    rng = np.random.default_rng(1)
    lattice = rng.integers(-2, 3, (400, 3)) / 3
    cloud = rng.standard_normal((50, 3))[rng.integers(0, 50, 300)]
    odd = np.array([[np.inf, 0, 1], [np.nan, 0, 0], [-np.inf, 1, 1], [np.nan, 0, 0], [np.inf, 0, 1]])
    with mock.patch.object(rows_module, "_MIXER", mixer):
        for points in (lattice, cloud, lattice[:1], np.vstack([lattice, odd]), lattice[:0]):
            points = points.astype(kind) + kind(0)
            rows, rank = np.unique(points, axis=0, return_inverse=True)
            found, place = rows_module.merge_equal(points)
            assert is_same(found, rows)
            assert np.array_equal(place, rank.reshape(-1))


def test_rows_that_agree_in_the_leading_bits_of_their_mix_are_told_apart_by_the_others():
    points = np.array([[1.0, 2, 3], [4, 5, 6], [1, 2, 3], [7, 8, 9]])
    merged = rows_module._merge_alike
    tried = []

    def refuse_first(*arguments):
        tried.append(arguments)
        return None if len(tried) == 1 else merged(*arguments)

    with mock.patch.object(rows_module, "_merge_alike", refuse_first):
        rows, place = rows_module.merge_equal(points)
    assert len(tried) == 2
    assert is_same(rows, points[[0, 1, 3]])
    assert place.tolist() == [0, 1, 0, 2]


# --- OBJ

FACES = OCTAHEDRON.faces.tolist()
PLAIN_OBJ = obj_bytes(OCTAHEDRON.vertices, FACES)
USUAL_OBJ = {
    "plain": PLAIN_OBJ,
    "carriage returns": PLAIN_OBJ.replace(b"\n", b"\r\n"),
    "without a last line end": PLAIN_OBJ.rstrip(),
    "tabs and blanks": PLAIN_OBJ.replace(b" ", b"  \t").replace(b"\n", b" \n"),
    "comments, groups and normals": b"# made by x\nmtllib a.mtl\n"
    + PLAIN_OBJ.replace(b"v ", b"vn 0 0 1\nv ").replace(b"f ", b"\ns off\nusemtl f\nf "),
    "colours": re.sub(rb"(v .*)", rb"\1 0.5 0.25 1", PLAIN_OBJ),
    "quads and pentagons": obj_bytes(CUBE_VERTICES, [*CUBE_QUADS, [0, 1, 5], [0, 1, 5, 7, 4]]),
}
for suffix in (b"/1/2", b"//3", b"/4"):
    USUAL_OBJ[f"corners with {suffix.decode()}"] = b"".join(
        line.rstrip().replace(b" ", suffix + b" ").replace(b"f" + suffix, b"f") + suffix + b"\n"
        if line.startswith(b"f ")
        else line
        for line in PLAIN_OBJ.splitlines(keepends=True)
    )
USUAL_OBJ["counted from the end"] = b"".join(
    b"f " + b" ".join(b"%d" % (int(word) - 7) for word in line.split()[1:]) + b"\n" if line.startswith(b"f ") else line
    for line in PLAIN_OBJ.splitlines(keepends=True)
)


@pytest.mark.parametrize("data", USUAL_OBJ.values(), ids=USUAL_OBJ)
@pytest.mark.parametrize("part", [1, 100, 10**6])
def test_obj_files_as_programs_write_them_are_read_in_bulk_in_parts_of_any_size(data, part):
    with mock.patch.object(obj, "_PART", part), mock.patch.object(numbers, "_LARGE", 0):
        found = obj._read_plain(data)
    assert found is not None
    assert is_same(found, obj._read_any(data))


mutation = st.tuples(
    st.floats(0, 1),
    st.integers(0, 4),
    st.sampled_from(
        [b"", b" ", b"\n", b"\r", b"\t", b"\x0b", b"/", b"//", b"\\", b"\\\n", b"#", b"f ", b"fo 1 2 3\n", b"v ",
         b"v\n",
         b"\nf \n", b"-1", b"0", b"x", b"nan", b"1e999", b"\nvn 1 2 3\n", b"facet", b" vertex ", b"endsolid",
         b"endsolid a\nsolid b\n", b"ENDFACET", b"normal", b"\0"]
    ),
)  # fmt: skip
mutations = st.lists(mutation, min_size=1, max_size=3)


def changed(data, changes):
    for where, n_removed, inserted in changes:
        at = int(where * len(data))
        data = data[:at] + inserted + data[at + n_removed :]
    return data


@settings(max_examples=200, deadline=None)
@given(name=st.sampled_from([*USUAL_OBJ]), changes=mutations)
@example(name="plain", changes=[(0.5, 2, b""), (0.5, 4, b"\\\n")])  # a keyword that is continued: "v", "\\"
def test_what_is_unusual_in_an_obj_file_is_left_to_the_careful_reader(name, changes):
    data = changed(USUAL_OBJ[name], changes)
    with mock.patch.object(obj, "_PART", 150):
        found = obj._read_plain(data)
    if found is not None:
        careful = or_none(obj._read_any, data)
        assert careful is not None
        assert np.array_equal(found[0], careful[0], equal_nan=True)
        assert is_same(found[1], careful[1])


# --- ASCII STL

PLAIN_STL = stl_text_bytes(OCTAHEDRON.vertices, OCTAHEDRON.faces)
USUAL_STL = {
    "plain": PLAIN_STL,
    "upper case": PLAIN_STL.upper(),
    "exponents": PLAIN_STL.replace(b"1.0", b"1.0e+00").replace(b"0 0 0", b"-2.588061e-01 nan 1E5"),
    "tabs and carriage returns": PLAIN_STL.replace(b" ", b"\t").replace(b"\n", b"\r\n"),
    "on one line": PLAIN_STL.replace(b"\n", b" "),
    "without names": PLAIN_STL.replace(b" thing", b""),
    "a name of keywords": PLAIN_STL.replace(b"thing", b"vertex 1 2 3 endloop"),
}


@pytest.mark.parametrize("text", USUAL_STL.values(), ids=USUAL_STL)
@pytest.mark.parametrize("part", [300, 10**6])
def test_stl_files_as_programs_write_them_are_read_in_bulk_in_parts_of_any_size(text, part):
    with mock.patch.object(stl, "_PART", part):
        found = stl._read_plain_text(text)
    assert found is not None
    assert is_same(found, stl._read_any_text(text.lower()))


@settings(max_examples=200, deadline=None)
@given(name=st.sampled_from([*USUAL_STL]), changes=mutations)
@example(name="plain", changes=[(0.625, 0, b"\0")])  # between two facets
def test_what_is_unusual_in_an_stl_file_is_left_to_the_careful_reader(name, changes):
    text = changed(USUAL_STL[name], changes)
    with mock.patch.object(stl, "_PART", 600):
        found = stl._read_plain_text(text)
    if found is not None:
        careful = or_none(stl._read_any_text, text.lower())
        assert careful is not None
        assert np.array_equal(found, careful, equal_nan=True)


# --- OFF

ROWS = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1 {0}\n3 0 1 3 {0}\n4 1 2 3 0 {0}\n3 0 3 2 {0}\n"


@pytest.mark.parametrize("colour", ["255 0 0", "0.5 0.25 1 1", "7"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r", "\n\n"])
@pytest.mark.parametrize("more", ["", "9 9\n", " \n"])
def test_faces_of_an_off_file_with_colours_are_read_in_bulk(colour, line_end, more):
    body = (ROWS.format(colour) + more).replace("\n", line_end).encode()
    header = off._read_header(b"OFF\n4 4 0\n")
    found = off._read_plain_lines(body, numbers.parse_numbers(body), header)
    assert is_same(found, off._read_lines(body, header))
    assert is_same(
        found, (TETRAHEDRON[0], Polygons(np.array([3, 3, 4, 3]), np.array([0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 0, 3, 2])))
    )


@settings(max_examples=150, deadline=None)
@given(changes=mutations, colour=st.sampled_from(["", "255 0 0"]))
def test_what_is_unusual_in_an_off_file_is_left_to_the_careful_reader(changes, colour):
    body = changed(ROWS.format(colour).encode(), changes)
    header = off._read_header(b"OFF\n4 4 0\n")
    found = off._read_plain_lines(body, numbers.parse_numbers(body), header)
    if found is not None:
        assert is_same(found, off._read_lines(body, header))


# --- legacy VTK


@settings(max_examples=100, deadline=None)
@given(words=st.lists(st.sampled_from(["1", "2e5", "nan", "INF", "Infinity", "infinite", "CELLS", "_a", "é", "-x"])))
def test_the_numbers_of_a_vtk_section_end_at_the_next_word_of_letters(words):
    data = " ".join(words).encode()
    expected = re.search(rb"(?<![^\s])(?!(?:nan|inf|infinity)\b)[A-Za-z_]", data, re.IGNORECASE)
    for part in (1, 4, 10**6):
        with mock.patch.object(vtk_legacy, "_PART", part):
            assert vtk_legacy._next_keyword(data, 0) == (expected.start() if expected else None)
