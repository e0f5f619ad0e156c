import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from studies.planning.command_line import quote_argument, swept_folder, swept_options


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
    override = OverridesParser.create().parse_override(quote_argument(f"segmenter.command={command}"))
    assert override.key_or_group == "segmenter.command"
    assert str(override.value()) == command


@pytest.mark.parametrize(
    "argument",
    ["segmenter.command='mytool {mesh} {labels}'", "segmenter.command='a','b'", "segmenter=external", "levels=[1,2]",
     "-m", "segmenter.command=", "+perturbation.command={a:1}"],
)  # fmt: skip
def test_whatever_else_there_is_stays(argument):
    assert quote_argument(argument) == argument


def test_a_job_of_a_sweep_has_a_folder_named_after_what_is_swept():
    arguments = ["-m", "+study=holes,scaling", "segmenter.time=0.5,1", "repeats=2", "dataset=bundled,files"]
    job = ["+study=holes", "segmenter.time=0.5", "repeats=2", "dataset=files"]
    swept = swept_options(arguments, job)
    assert swept == {"segmenter.time": "0.5"}
    assert swept_folder(swept) == "segmenter.time=0.5"
    assert swept_options(["+study=holes", "repeats=2"], ["+study=holes", "repeats=2"]) == {}
