"""A perturbation of the user's own, as docs/perturbations.md shows it: typed in a folder of theirs."""

import shlex
import sys

import pandas as pd
import pytest

from tests.helpers.documents import ROOT, blocks, section
from tests.studies.conftest import in_fork

PAGE = (ROOT / "docs" / "perturbations.md").read_text(encoding="utf-8")


@pytest.fixture
def example():
    """The page's code, and its two commands as words."""
    code, run, check = blocks(section(PAGE, "## Write one"))
    assert code.title == "my_package.py"
    return code.text, shlex.split(run.text), shlex.split(check.text)


def test_the_example_runs_where_it_is_typed(here, example, interpreter):
    code, (_, *run), (_, _, check) = example
    (here / "my_package.py").write_text(code)
    done = interpreter.run([*run, "dataset=files", "dataset.glob=ant.off", "engine.workers=1"], here)
    assert done.returncode == 0, done.stderr
    done = in_fork(here, lambda: exec(check, {}), "-c")
    assert done.returncode == 0, done.stderr
    folder = here / "mine" / "stretch" / "files"
    rows = pd.read_parquet(folder / "trials.parquet")
    assert rows["status"].tolist() == ["ok"] * 3
    assert rows["perturbation"].unique().tolist() == ["stretch"]
    assert (rows["change_percentage"] > 0).any()
    assert (folder / "gallery.png").exists()
    assert pd.read_csv(folder / "table.csv")["paper"].isna().all()  # the paper has no value for it


def test_other_code_is_another_perturbation(here, own_modules, plan, example):
    sys.path.insert(0, str(own_modules))
    code, (_, _, _, *words), _ = example
    words = [*words, "dataset=files", "dataset.glob=ant.off"]
    (own_modules / "my_package.py").write_text(code)
    before = plan(*words)
    assert [t.trial_id for t in plan(*words)] == [t.trial_id for t in before]
    (own_modules / "my_package.py").write_text(code.replace("[self.amount, 0, 0]", "[0, self.amount, 0]"))
    after = plan(*words)
    assert not {t.trial_id for t in before} & {t.trial_id for t in after}
    assert [t.seed for t in before] == [t.seed for t in after]
