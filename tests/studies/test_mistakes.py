"""Wrong values for every shipped option: a message of one line, before anything runs or is written."""

import pytest
from hydra import compose, initialize_config_module
from hydra.errors import HydraException

from studies.planning.command_line import check_groups, flags_last, quote_argument
from studies.planning.configuration import configure
from tests.helpers.composing import as_hydra_does, composition
from tests.studies.conftest import typed

pytestmark = pytest.mark.usefixtures("charts_as_text")

FILES = ("dataset=files", "dataset.glob=ant.off", "engine=serial", "dry_run=true")

# Kinds of values, as they are typed.
NULL, NUMBER, FRACTION, NEGATIVE, TEXT, FLAG, LIST, NESTED, MAPPING, EMPTY, NAN = (
    "null", "5", "3.5", "-1", "two", "true", "[a,b]", "[[5]]", "{a: 1}", "''", "nan",
)  # fmt: skip
ALL = (NULL, NUMBER, FRACTION, NEGATIVE, TEXT, FLAG, LIST, NESTED, MAPPING, EMPTY, NAN)

# Study and what else is typed -> option -> the kinds of values that are right.
ACCEPTED = {
    ("+study=holes", *FILES): {
        "repeats": {NUMBER},
        "results_dir": {*ALL} - {NULL, EMPTY},  # whatever is typed is a path
        "trial": set(),
        "trial.timeout": {NULL},  # engine=serial has no limits
        "trial.memory": {NULL},
        "on_error": set(),
        "retry_failed": {FLAG},
        "fresh": {FLAG},
        "dry_run": {FLAG},
        "publication": {NULL, EMPTY},
        "segmenters": {NULL},
        "swept": set(),
        "gallery": set(),
        "gallery.models": {NUMBER},  # a list names models of the study
        "gallery.columns": {NUMBER},
        "gallery.style": set(),
        "title": {TEXT, EMPTY},
        "axis": {TEXT, EMPTY},
        "study": set(),
        "study.name": {TEXT},
        "levels": set(),
        "perturbation": set(),
        "perturbation.unit": set(),
        "perturbation.amount": {NUMBER, FRACTION, NEGATIVE, NAN},  # the levels replace it
        "perturbation._target_": set(),
        "dataset": set(),
        "dataset.glob": set(),
        "dataset.name": {TEXT},
        "dataset._target_": set(),
        "segmenter": set(),
        "segmenter.time": {NUMBER, FRACTION},
        "segmenter.time_unit": set(),
        "segmenter.density": set(),
        "segmenter.split_dissipators": {FLAG},
        "segmenter._target_": set(),
        "engine": set(),
        "engine._target_": set(),
        "experiment": set(),
        "experiment._target_": set(),
        "no_such_option": set(),
    },
    ("+study=holes", *FILES, "engine=local"): {
        "engine.workers": {NULL, NUMBER},
        "trial.timeout": {NULL, NUMBER, FRACTION},
        "trial.memory": {NULL, NUMBER},
    },
    ("+study=holes", *FILES, "engine=dask", "engine.address=tcp://HOST:8786"): {
        "engine.address": {TEXT},
        "engine.cluster": {NULL},
        "engine.workers": {NULL, NUMBER},
        "engine.wait": {NULL, NUMBER, FRACTION},
    },
    ("+study=shot_noise", *FILES): {
        "perturbation.height": {NUMBER, FRACTION},
        "perturbation.height_unit": set(),
    },
    ("+study=normal_noise", *FILES): {"perturbation.distribution": set()},
    ("+study=decimation", *FILES): {"perturbation.backend": set()},
    ("+study=missing_parts", *FILES): {"perturbation.shape": set()},
    ("+study=short_circuits", *FILES): {"perturbation.bridge": set()},
    ("+study=tessellation", *FILES): {
        "parts": set(),
        "parts.isotropic": set(),
        "parts.isotropic.levels": set(),
        "parts.isotropic.title": {TEXT, EMPTY},
        "parts.isotropic.axis": {TEXT, EMPTY},
        "parts.isotropic.perturbation": set(),
        "parts.isotropic.perturbation.method": set(),
    },
    ("+study=holes", "engine=serial", "dry_run=true"): {"dataset.models": {NULL}},
    ("+study=table1", "engine=serial", "dry_run=true", "dataset.root=nowhere"): {
        "dataset.root": set(), "dataset.categories": set(), "dataset.models": set(),
    },
    ("+study=pose", "engine=serial", "dry_run=true", "dataset.root=nowhere"): {
        "dataset.root": set(), "dataset.categories": set(), "dataset.models": set(),
        "plates": set(), "plates.figure6": set(), "plates.figure6.models": set(), "plates.figure6.upright": set(),
    },
    ("+study=time", *FILES): {
        "times": set(),
        "times.first": {NUMBER, FRACTION},
        "times.last": {NUMBER, FRACTION},
        "times.count": {NUMBER},
        "intervals": set(),
        "models_drawn": {NULL, NUMBER},
        "seed": {NUMBER},
        "figure15.stem": {TEXT},
        "figure15.models": set(),
        "figure15.times": set(),
    },
    ("+study=anatomy", *FILES): {
        "plates": set(),
        "plates.figure1": set(),
        "plates.figure1.shows": set(),
        "plates.figure1.models": {NULL},
    },
    ("+study=holes", *FILES, "segmenter=external"): {
        "segmenter.command": set(), "segmenter.suffix": set(), "segmenter.labels_of": set(),
    },
    ("+study=custom", *FILES): {"study.name": set(), "experiment._target_": set()},
}  # fmt: skip


@pytest.fixture
def mistake():
    """A function: words -> what is wrong with a command, found as the command finds it; None if nothing is."""
    with initialize_config_module("conf", version_base="1.3"):
        yield mistake_in


def mistake_in(words):
    options = [quote_argument(word) for word in words]
    try:
        check_groups(options)
        configure(composition(options), options).plan()
    except (ValueError, OSError, HydraException) as error:
        return str(error)
    return None


@pytest.mark.parametrize(
    ("words", "option"), [(words, option) for words, options in ACCEPTED.items() for option in options]
)
def test_a_value_of_the_wrong_kind_is_refused_and_one_of_the_right_kind_is_not(here, words, option, mistake):
    accepted = {value for value in ALL if mistake([*words, f"{option}={value}"]) is None}
    assert accepted == ACCEPTED[words][option]
    assert [path.name for path in here.iterdir()] == ["ant.off"]


def result_of(function, *arguments):
    """What a function returns or raises."""
    try:
        return function(*arguments)
    except (HydraException, ValueError) as error:
        return type(error), str(error)


@pytest.mark.parametrize(
    "word",
    [
        "repeats=7", "levels=[1,2]", "levels=[[5]]", "gallery=null", "gallery={models: 2}", "title='a: {b}'",
        "segmenter.time=soon", "perturbation._target_=x", "trial={timeout: 5}", "dataset={glob: a}",
        "dataset=psb", "dataset=5", "segmenter=external", "engine=none", "engine@trial=local", "perturbation=holes",
        "+segmenter.new=1", "+levels=[3]", "++segmenter.time=2", "++new.option={a: 1}", "+dataset=psb",
        "~title", "~gallery.models", "~gallery.models=4", "~no_such_option", "~segmenter", "no_such_option=1",
        "levels=[1", "repeats=1,2", "levels=range(1,5)", "results_dir=${title}", "hydra.job.name=x",
    ],
)  # fmt: skip
def test_what_the_tests_compose_is_what_hydra_composes(here, word):
    with initialize_config_module("conf", version_base="1.3"):
        words = ["+study=holes", "repeats=2", word, *FILES]
        composed = result_of(composition, words)
        with as_hydra_does():
            assert composed == result_of(compose, "config", words)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("levels=5", "levels is 5: it must be a list, as in 'levels=[0.1,0.2]'"),
        ("levels=[[5]]", "levels contains [5], which is not a number"),
        ("levels=[nan]", "levels contains nan, which is not finite"),
        ("dataset.name=2024", "dataset.name is 2024: it must be text"),
        ("dataset.glob=[a,b]", "matches dataset.glob='[a,b]'"),
        ("gallery=null", "gallery is None: it must be a mapping of options"),
        ("trial=null", "trial is None: it must be a mapping of options"),
        ("engine.workers=two", "engine.workers is 'two': must be a whole number of at least 1, or null"),
        ("trial.timeout=10min", "trial.timeout is '10min': must be a number of seconds above 0, or null"),
        ("repeats=3.5", "repeats is 3.5: it must be a whole number"),
        ("retry_failed=maybe", "retry_failed is 'maybe': it must be true or false"),
        ("segmenter=null", "segmenter=null: it must be the name of a segmenter"),
        ("dataset=5", "dataset=5: it must be the name of a dataset"),
        ("segmenter.time=soon", "segmenter.time is 'soon': it must be a number"),
        ("segmenter.time=-1", "segmenter.time is -1: it must be above 0"),
        ("segmenter.density=faces", "segmenter.density is 'faces': choose one of vertices, area"),
        ("title=[a]", "title is ['a']: it must be text"),
        ("publication=../study/holes", "publication is '../study/holes': it must be null or one of heat_walk_2011"),
        ("dataset.name=../../x", "dataset.name is '../../x': it becomes a folder, and must not contain '/'"),
        ("dataset.name=..", "dataset.name is '..': it becomes a folder, and must have a letter or a digit"),
        ("dataset.name=/etc", "must not contain '/'"),
        ("dataset.name=labels", "that name is reserved"),
        ("dataset.name=Nul.txt", "that name is reserved"),
        ("study.name=../x", "study.name is '../x': it becomes a folder, and must not contain '/'"),
        ("study.name=x.before-20260101T000000", "that name is reserved"),
        (f"study.name={'x' * 240}", "must not be longer than 230 bytes"),
        ("study.name='a '", "must not begin or end with a space"),
        (r"study.name='a\\b'", r"must not contain '\\'"),
    ],
)
def test_the_message_is_one_line_that_names_the_option(here, word, message):
    words = [one for one in ("+study=holes", *FILES) if one != "engine=serial"]
    done = typed(here, *words, *(["engine=local"] if word.startswith(("engine", "trial")) else []), word)
    assert done.returncode == 2, done.stdout
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr
    assert [path.name for path in here.iterdir()] == ["ant.off"]


@pytest.mark.parametrize(
    "name",
    ["with space", "b[1]", "a=b", "Küche süß", "a,b", "it's", 'say "hi"', "(copy)", "50%", "{x}", "a+b&c", "100",
     "true", "null_", "#1", "$HOME", "a~b", "αβγ"],
)  # fmt: skip
def test_folders_of_any_name_are_taken_as_they_are_typed(here, name):
    folder = here / name
    folder.mkdir()
    (here / "ant.off").rename(folder / "ant.off")
    words = ("+study=scaling", "levels=[2]", "gallery.models=0", "segmenter=custom")
    words = (*words, "segmenter._target_=tests.helpers.segmenting.halves", "dataset=files", f"results_dir=out {name}")
    done = typed(here, *words, f"dataset.glob={name}")
    assert done.returncode == 0, done.stderr
    assert (here / f"out {name}" / "scaling" / "files" / "table.csv").exists()
    again = typed(here, *words, "repeats=2", f"dataset.glob={name}/*.off")
    assert again.returncode == 0, again.stderr
    assert "1 of them stored already" in again.stdout


def test_a_tilde_is_the_home_folder(here, monkeypatch, mistake):
    monkeypatch.setenv("HOME", str(here))
    assert mistake(["+study=holes", "dataset=files", "dataset.glob=~/ant.off", "engine=serial"]) is None
    assert mistake(["+study=holes", "dataset=files", "dataset.glob=~", "engine=serial"]) is None
    assert "~/Nowhere (2)".replace("~", str(here)) in mistake(["+study=table1", "dataset.root=~/Nowhere (2)"])


def test_the_values_of_a_sweep_are_quoted_each():
    assert quote_argument("dataset.glob=a b,c", is_sweep=True) == "dataset.glob='a b',c"
    assert quote_argument("results_dir=a,b", is_sweep=True) == "results_dir='a,b'"


def test_a_name_with_a_comma_is_one_value_of_a_sweep(here):
    (here / "a,b").mkdir()
    assert quote_argument("dataset.root=a,b", is_sweep=True) == "dataset.root='a,b'"


# Files that a sweep over levels leaves next to the folders of its values.
SUMMARY = [f"sweep_by_levels.{suffix}" for suffix in ("csv", "md", "tex", "png", "pdf")]


@pytest.mark.parametrize("place", [0, 1, 3, 6])
def test_a_sweep_may_be_asked_for_anywhere(here, place):
    words = ["+study=scaling", "levels=[1],[2]", "repeats=1", "gallery.models=0", *FILES[:3]]
    words[4:4] = ["segmenter=custom", "segmenter._target_=tests.helpers.segmenting.halves"]
    words.insert(place, "-m")
    done = typed(here, *words)
    assert done.returncode == 0, done.stderr
    folder = here / "results" / "scaling" / "files"
    assert {path.name for path in folder.iterdir()} == {"levels=[1]", "levels=[2]", *SUMMARY}


def test_flags_keep_their_values():
    words = ["--cfg", "job", "+study=holes", "--multirun", "a=1", "-cd", "conf", "b=2", "--info", "searchpath"]
    assert flags_last(words) == [
        "+study=holes", "a=1", "b=2", "--cfg", "job", "--multirun", "-cd", "conf", "--info", "searchpath",
    ]  # fmt: skip


def test_a_sweep_over_many_levels_has_a_folder_with_a_short_name(here):
    many = [f"[{','.join(f'{i}.{j:02}0000000001' for j in range(1, 31))}]" for i in (1, 2)]
    assert all(len(levels) > 445 for levels in many)
    words = ("-m", "+study=scaling", f"levels={','.join(many)}", "repeats=1", "gallery.models=0", *FILES[:3])
    done = typed(here, *words, "segmenter=custom", "segmenter._target_=tests.helpers.segmenting.halves")
    assert done.returncode == 0, done.stderr
    found = {path.name for path in (here / "results" / "scaling" / "files").iterdir()}
    names = found - {*SUMMARY}
    assert (len(found), len(names)) == (7, 2)
    assert all(len(name.encode()) <= 230 and name.startswith("levels=[") for name in names)


def test_what_is_typed_wrongly_ends_every_command_with_2(tmp_path):
    for words in (["--no-such-flag"], ["+study=holes,scaling"], ["+study"], ["+study=holes", "levels=[1"]):
        assert typed(tmp_path, *words).returncode == 2, words
