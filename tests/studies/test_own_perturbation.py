"""A perturbation of the user's own, as the README has it: in a folder of theirs, by the command that they type."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

README = Path(__file__).parents[2] / "README.md"


@pytest.fixture
def example():
    """The README's code and its command, as words."""
    _, section = README.read_text().split("**Your own perturbation**")
    code, command = re.findall(r"```(?:python)?\n(.*?)```", section, re.DOTALL)[:2]
    return "from dataclasses import dataclass\n\nimport perturb\n\n\n" + code, shlex.split(command.replace("\\\n", " "))


def test_the_example_runs_where_it_is_typed(here, example):
    code, (_, *words) = example
    (here / "my_package.py").write_text(code)
    done = subprocess.run(
        [sys.executable, *words, "dataset=files", "dataset.glob=ant.off", "engine.workers=1"],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    folder = here / "results" / "stretch" / "files"
    rows = pd.read_parquet(folder / "trials.parquet")
    assert rows["status"].tolist() == ["ok"] * 3
    assert rows["perturbation"].unique().tolist() == ["stretch"]
    assert (rows["change_percentage"] > 0).any()
    assert (folder / "gallery.png").exists()
    assert pd.read_csv(folder / "table.csv")["paper"].isna().all()  # the paper has no figure for it


def test_other_code_is_another_perturbation(here, own_modules, plan, example):
    sys.path.insert(0, str(own_modules))
    code, (_, _, _, *words) = example
    words = [*words, "dataset=files", "dataset.glob=ant.off"]
    (own_modules / "my_package.py").write_text(code)
    before = plan(*words)
    assert [t.trial_id for t in plan(*words)] == [t.trial_id for t in before]
    (own_modules / "my_package.py").write_text(code.replace("[self.amount, 0, 0]", "[0, self.amount, 0]"))
    after = plan(*words)
    assert not {t.trial_id for t in before} & {t.trial_id for t in after}
    assert [t.seed for t in before] == [t.seed for t in after]
