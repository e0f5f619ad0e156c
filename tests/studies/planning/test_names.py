import pytest

from studies.planning.errors import StudyError
from studies.planning.names import MAX_BYTES, check_name, folder_name


@pytest.mark.parametrize(
    "name", ["holes", "my holes", "Küche", "a=b", "a,b", "[1]", "it's", ".hidden", "a.b", "console", "ß" * 115]
)
def test_names_that_every_file_system_takes_are_accepted(name):
    assert check_name("study.name", name) == name
    assert folder_name(name) == name


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", " ", "a/b", "/a", "a\\b", "C:", "a\0", "a\nb", "a*", "a?", "a|b", "<a>", 'a"b', "a.", "a ", " a",
     "con", "CON", "com1.txt", "lpt9", "labels", "x.before-20261127T101010", "ß" * 116, chr(0xDC80), None, 5, ["a"]],
)  # fmt: skip
def test_names_that_are_paths_or_refused_by_a_file_system_are_mistakes(name):
    with pytest.raises(StudyError, match=r"^study\.name is "):
        check_name("study.name", name)


@pytest.mark.parametrize("text", ["a/b", "a:b", "x" * 300, "é" * 200, "a*b", "a.", chr(0xDC80)])
def test_a_text_becomes_a_name_that_every_file_system_takes(text):
    name = folder_name(text)
    assert check_name("study.name", name) == name
    assert len(name.encode()) <= MAX_BYTES


def test_different_texts_have_different_names():
    texts = ["a/b", "a:b", "a_b", "x" * 300, "x" * 301, "a.", "a"]
    assert len({folder_name(text) for text in texts}) == len(texts)
