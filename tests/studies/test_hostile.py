"""Segmenters, perturbations, metrics and datasets that end the program: each is a failed row, and the others run."""

import contextlib
import json
import os
import signal
import threading
import time

import pandas as pd
import pytest
from rich.console import Console

from studies.execution.interruption import is_ctrl_c, watch_ctrl_c
from studies.execution.study import run_study
from studies.metrics import registry
from studies.metrics.metric import Metric
from studies.planning.targets import locate
from tests.helpers.hostile import DEEDS
from tests.studies.conftest import typed

pytestmark = pytest.mark.usefixtures("charts_as_text")

SCALING = (
    "+study=scaling", "dataset=files", "dataset.glob=ant.off", "segmenter=custom", "gallery.models=0",
    "segmenter._target_=tests.helpers.hostile.halves", "levels=[1,2,3]", "repeats=1",
)  # fmt: skip

ENGINES = {
    "serial": ("engine=serial",),
    "local": ("engine=local", "engine.workers=1"),
    "dask": (
        "engine=dask",
        "engine.cluster={_target_:distributed.LocalCluster,n_workers:1,threads_per_worker:1,dashboard_address:null}",
    ),
}


@pytest.fixture
def outcome_of(here, configured):
    """A function: options -> the rows by level or model, and the outcome of the study."""

    def run(*words):
        if "engine=dask" in words:
            pytest.importorskip("distributed", reason="the extra 'dask' is not installed")
        outcome = run_study(configured(*words), Console())
        return pd.read_parquet(outcome.results.folder / "trials.parquet"), outcome

    return run


def checked(rows, error):
    assert rows["status"].tolist() == ["ok", "failed", "ok"]
    assert rows["error"].dropna().tolist() == [error]


@pytest.mark.parametrize("engine", [name if name != "dask" else pytest.param(name, marks=pytest.mark.slow)
                                    for name in ENGINES])  # fmt: skip
def test_whatever_a_segmenter_raises_is_one_failed_row(outcome_of, engine):
    methods = [f"{{_target_:tests.helpers.hostile.halves,deed:{deed}}}" for deed in DEEDS]
    words = [word for word in SCALING if not word.startswith("segmenter")]
    rows, outcome = outcome_of(*words, f"segmenters=[{','.join(methods)}]", *ENGINES[engine])
    assert not outcome.ended_early
    of_deed = {deed: rows["segmenter_options"].map(json.loads).map(lambda o, d=deed: o["deed"] == d) for deed in DEEDS}
    assert sum(map(sum, of_deed.values())) == len(rows)
    for deed, (_, error) in DEEDS.items():
        checked(rows[of_deed[deed]], error)


def test_dask_makes_a_failed_row_of_an_exit_too(outcome_of):
    rows, _ = outcome_of(*SCALING, *ENGINES["dask"])
    checked(rows, "SystemExit: 0")


@pytest.mark.parametrize("engine", ["serial", "local"])
def test_a_perturbation_that_exits_is_a_failed_row(outcome_of, engine):
    words = [word for word in SCALING if not word.startswith("+study")]
    rows, _ = outcome_of(
        "+study=scaling", *words, "perturbation._target_=tests.helpers.hostile.Leaving",
        "segmenter._target_=tests.helpers.segmenting.halves", *ENGINES[engine],
    )  # fmt: skip
    checked(rows, "SystemExit: 0")


@pytest.mark.parametrize("engine", ["serial", "local"])
def test_a_dataset_that_exits_while_it_reads_a_model_costs_the_rows_of_that_model(outcome_of, engine):
    words = [word for word in SCALING if not word.startswith("dataset")]
    rows, _ = outcome_of(
        *words, "dataset=custom", "dataset._target_=tests.helpers.hostile.Leavers", "levels=[1,3]", *ENGINES[engine]
    )
    assert rows.groupby("model")["status"].unique().map(list).to_dict() == {"a": ["failed"], "b": ["ok"]}
    assert set(rows["error"].dropna()) == {"SystemExit: 0"}


@pytest.mark.parametrize(
    ("value", "error"),
    [
        (None, "SystemExit: 0"),
        (object(), "TypeError: the metric rand_index_error returned <object objec"),
        ("much", "TypeError: the metric rand_index_error returned 'much', which is no float64"),
        (2**70, "TypeError: the metric rand_index_error returned"),
    ],
)
def test_a_metric_that_exits_or_returns_no_number_is_a_failed_row(outcome_of, monkeypatch, value, error):
    found = dict(registry._discovered())

    def misbehave(comparison):
        if value is None:
            raise SystemExit(0)
        return value

    found["rand_index_error"] = Metric(column=found["rand_index_error"].column, function=misbehave)
    monkeypatch.setattr(registry, "_discovered", lambda: found)
    rows, _ = outcome_of(*SCALING, "levels=[1]", "engine=serial")
    assert rows["status"].tolist() == ["failed"]
    assert rows["error"][0].startswith(error)


@pytest.mark.parametrize("what", ["segmenter", "dataset", "perturbation", "experiment"])
def test_a_module_that_exits_when_it_is_imported_is_a_mistake_of_one_line(here, what):
    (here / "leaving_at_once.py").write_text("import sys\nsys.exit(0)\n")
    words = {
        "segmenter": ("+study=scaling", "segmenter=custom"),
        "dataset": ("+study=scaling", "dataset=custom"),
        "perturbation": ("+study=scaling",),
        "experiment": ("+study=custom", "study.name=own"),
    }[what]
    done = typed(here, *words, f"{what}._target_=leaving_at_once.Thing")
    assert done.returncode == 2, done.stderr
    assert done.stderr == f"studies.run: error: {what}._target_=leaving_at_once.Thing: SystemExit: 0\n"


def test_a_dataset_that_exits_while_it_is_planned_is_a_mistake_of_one_line(here):
    (here / "leaving_later.py").write_text(
        "import sys\nfrom studies.datasets import Dataset\n"
        "class Thing(Dataset):\n    name = 'thing'\n    def models(self):\n        sys.exit(0)\n"
    )
    done = typed(here, "+study=scaling", "dataset=custom", "dataset._target_=leaving_later.Thing")
    assert done.returncode == 2
    assert done.stderr.startswith("studies.run: error: SystemExit: 0")
    assert done.stderr.count("\n") == 1


def press_ctrl_c():
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(5)


@pytest.fixture
def usual_ctrl_c():
    """Python's own handler of Ctrl-C, which modules that other tests import may have replaced."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("usual_ctrl_c")
def test_ctrl_c_is_told_from_an_exception_of_its_kind():
    with watch_ctrl_c() as was_pressed:
        assert not is_ctrl_c(KeyboardInterrupt())
        assert not was_pressed()
        with pytest.raises(KeyboardInterrupt) as pressed:
            press_ctrl_c()
        assert is_ctrl_c(pressed.value)
        assert was_pressed()
        assert not is_ctrl_c(SystemExit())
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_module_of_a_target_leaves_ctrl_c_as_it_was(own_modules, monkeypatch):
    (own_modules / "leaving_on_ctrl_c.py").write_text(
        "import signal, sys\nsignal.signal(signal.SIGINT, lambda *_: sys.exit())\ndef halves(vertices, faces): ...\n"
    )
    monkeypatch.syspath_prepend(own_modules)
    before = signal.getsignal(signal.SIGINT)
    assert locate("segmenter", "leaving_on_ctrl_c.halves", ValueError).__name__ == "halves"
    assert signal.getsignal(signal.SIGINT) is before


def test_outside_the_main_thread_no_exception_is_ctrl_c():
    seen = []

    def look():
        with watch_ctrl_c():
            seen.append(is_ctrl_c(KeyboardInterrupt()))

    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert seen == [False]


def catch_everything(vertices, faces):
    """A segmenter that swallows Ctrl-C, which comes during its first trial."""
    with contextlib.suppress(BaseException):
        press_ctrl_c()
    return vertices[:, 0] > 0


def test_a_segmenter_that_swallows_ctrl_c_does_not_keep_the_study_from_ending(outcome_of, here, configured):
    outcome = run_study(
        configured(*SCALING, f"segmenter._target_={__name__}.catch_everything", "engine=serial"), Console()
    )
    assert outcome.interrupted
