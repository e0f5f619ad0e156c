import re
import zipfile

import numpy as np
import pytest

from heatwalk.io import parse_integers, read_integers
from heatwalk.meshes import MeshError


def test_integers_are_returned_in_the_order_of_the_lines_whatever_surrounds_them():
    numbers = parse_integers(" 3\n0\t\r\n12 \n007\n\n \n")
    assert numbers.tolist() == [3, 0, 12, 7]
    assert numbers.dtype == np.int64


def test_signs_are_accepted_only_on_request():
    assert parse_integers("-1\n+2\n", signed=True).tolist() == [-1, 2]
    with pytest.raises(ValueError, match=r"^line 1 is not an integer: '-1'$"):
        parse_integers("-1\n+2\n")


@pytest.mark.parametrize("line", ["", "1 2", "1.0", "one", "1e3", "0x1", "1_000", "9" * 19, "٣", "\ufeff1"])
def test_a_line_that_is_not_one_integer_is_rejected_with_its_number(line):
    with pytest.raises(ValueError, match=rf"^line 2 is not a vertex number: {re.escape(repr(line[:40]))}$"):
        parse_integers(f"1\n{line}\n3\n", "a vertex number", signed=True)


def test_text_without_lines_has_no_integers_but_a_file_without_lines_is_rejected(tmp_path):
    assert parse_integers(" \n\n").shape == (0,)
    (tmp_path / "empty.txt").write_text(" \n\n")
    with pytest.raises(MeshError, match=re.escape(f"{tmp_path / 'empty.txt'}: the file is empty")):
        read_integers(tmp_path / "empty.txt")


def test_files_inside_a_zip_are_read(tmp_path):
    with zipfile.ZipFile(tmp_path / "labels.zip", "w") as archive:
        archive.writestr("folder/labels.txt", "5\n6\n")
    path = zipfile.Path(tmp_path / "labels.zip", "folder/labels.txt")
    assert read_integers(path).tolist() == [5, 6]


def test_the_path_is_part_of_the_message(tmp_path):
    path = tmp_path / "labels.txt"
    with pytest.raises(MeshError, match=re.escape(f"{path}: cannot be read: No such file or directory")):
        read_integers(str(path))
    path.write_text("1\nx\n")
    with pytest.raises(MeshError, match=re.escape(f"{path}: line 2 is not an integer: 'x'")):
        read_integers(path)


def test_integers_of_nineteen_digits_keep_all_of_them():
    text = "9223372036854775807\n1000000000000000001\n0000000000000000000000007\n"
    assert parse_integers(text).tolist() == [9223372036854775807, 1000000000000000001, 7]
    assert parse_integers("-9223372036854775808\n", signed=True).tolist() == [-9223372036854775808]
    with pytest.raises(ValueError, match="line 1 is not an integer: '9223372036854775808'"):
        parse_integers("9223372036854775808\n")


def test_a_byte_order_mark_is_passed_over_and_lines_end_with_ascii_line_ends_only(tmp_path):
    (tmp_path / "a.seg").write_bytes(b"\xef\xbb\xbf4\r\n5\r6\n")
    assert read_integers(tmp_path / "a.seg").tolist() == [4, 5, 6]
    for separator in ("\u2028", "\x85", "\x0b", "\x1c"):
        with pytest.raises(ValueError, match="line 1 is not an integer"):
            parse_integers(f"1{separator}2\n")
