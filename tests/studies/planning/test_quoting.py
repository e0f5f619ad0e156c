import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from studies.planning.quoting import quoted


@pytest.mark.parametrize(
    "command",
    [
        "mytool {mesh} {labels}",
        "mytool --range=1,5 [x] {mesh} {labels}",
        "python 'my tool.py' {mesh} {labels}",
        "\"my tool\" {mesh} {labels} ''",
        r"sed s/\'a\\/b/ {mesh} {labels} it\'s \\",
    ],
)
def test_a_command_reaches_the_study_as_it_left_the_shell(command):
    override = OverridesParser.create().parse_override(quoted(f"segmenter.command={command}"))
    assert override.key_or_group == "segmenter.command"
    assert str(override.value()) == command


@pytest.mark.parametrize(
    "argument",
    ["segmenter.command='mytool {mesh} {labels}'", "segmenter.command='a','b'", "segmenter=external", "levels=[1,2]",
     "-m", "segmenter.command=", "+perturbation.command={a:1}"],
)  # fmt: skip
def test_whatever_else_there_is_stays(argument):
    assert quoted(argument) == argument
