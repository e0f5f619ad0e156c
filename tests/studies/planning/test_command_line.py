import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from studies.planning.command_line import add_missing_options, list_globbed_studies, quote_argument, swept_folder


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
    assert swept_folder(arguments, job) == "segmenter.time=0.5"
    assert swept_folder(["+study=holes", "repeats=2"], ["+study=holes", "repeats=2"]) == ""


def studies_of(argument, *others):
    """The studies that a sweep over ``argument`` runs."""
    return set(list_globbed_studies([argument, *others])[0].removeprefix("+study=").split(","))


def test_a_glob_over_studies_matches_all_but_the_one_that_is_none_yet():
    everything = studies_of("+study=glob(*)")
    assert {"holes", "table2", "pose", "anatomy"} <= everything
    assert "custom" not in everything
    assert studies_of("+study=glob(*,exclude=[table*,pose])") == everything - {"table1", "table2", "pose"}
    assert studies_of("+study=glob([figure*,cust*])") == {"figure10", "figure12", "figure9"}


@pytest.mark.parametrize("words", [["+study=holes,scaling"], ["+study=custom"], ["+study=x", "a=glob(*)"], ["-m"]])
def test_other_choices_of_studies_stay(words):
    assert list_globbed_studies(words) == words


@pytest.mark.parametrize("flag", ["--config-dir", "-cd"])
def test_studies_in_a_folder_of_the_user_are_matched_and_have_options(tmp_path, monkeypatch, flag):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "my conf" / "study"
    folder.mkdir(parents=True)
    (folder / "own.yaml").write_text("# @package _global_\nstudy: {name: own}\ntitle: Own\nlevels: [1]\n")
    assert studies_of("+study=glob(o*)", flag, "my conf") == {"own"}
    assert "own" not in studies_of("+study=glob(*)")
    words = ["+study=own,holes", "levels=[2]", "-m", flag, "my conf"]
    assert add_missing_options(words) == ["+study=own,holes", "++levels=[2]", *words[2:]]
