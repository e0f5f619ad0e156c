import json
from pathlib import Path

import pandas as pd
import pytest

from studies import merge
from studies.planning.trial import TIMINGS
from studies.storage import planned_ids
from tests.studies.test_survival import FOLDER, rows, table

pytestmark = pytest.mark.usefixtures("charts_as_text")


def said(capsys):
    return " ".join(capsys.readouterr().err.split())


def join(*words):
    return merge.main([word if word[:2] == "--" or word == "joined" else f"{word}/{FOLDER}" for word in words])


def test_parts_of_a_study_joined_are_the_study(study, here):
    words = ("repeats=2", "levels=[0.1,0.2,0.3]")
    study(*words, results="whole")
    study(words[0], "levels=[0.1,0.3]", results="a")
    study("repeats=1", "levels=[0.2,0.1]", results="b")
    (here / "broken").touch()
    study(words[0], "levels=[0.2]", "trial.timeout=null", results="c")
    (here / "broken").unlink()
    study("repeats=2", "levels=[0.2]", "retry_failed=true", results="c")
    assert join("a", "b", "--into", "joined") == 0
    assert merge.main(["joined", f"c/{FOLDER}"]) == 0
    ours, theirs = (
        pd.read_parquet(path).set_index("trial_id").drop(columns=list(TIMINGS))
        for path in ("joined/trials.parquet", f"whole/{FOLDER}/trials.parquet")
    )
    pd.testing.assert_frame_equal(ours.loc[theirs.index], theirs)
    assert len(ours) == 6
    ours, theirs = (pd.read_csv(f"{name}/table.csv").set_index("level") for name in ("joined", f"whole/{FOLDER}"))
    pd.testing.assert_frame_equal(ours.sort_index(), theirs)


def test_repeats_joined_in_order_give_the_same_table_to_the_byte(study):
    study("repeats=3", results="whole")
    study("repeats=3", "levels=[0.1]", results="a")
    study("repeats=3", "levels=[0.2]", results="b")
    assert join("a", "b") == 0
    assert table("a") == table("whole")
    pd.testing.assert_frame_equal(rows("a"), rows("whole"))
    assert planned_ids(Path("a") / FOLDER) == rows("whole")["trial_id"].tolist()
    assert study("repeats=3", results="a")  # and the study goes on from what was joined
    assert table("a") == table("whole")


@pytest.mark.parametrize("order", ["ab", "ba"])
def test_a_row_that_failed_gives_way_to_one_that_did_not(study, here, order):
    study("repeats=2", results="b")
    (here / "broken").touch()
    study("repeats=2", results="a")
    assert join(*order) == 0
    assert rows(order[0])["status"].tolist() == ["ok"] * 4
    assert table(order[0]) == table("b")


def test_what_does_not_match_is_refused_and_named(study, here, capsys):
    study("repeats=1", results="a")
    study("repeats=1", "+segmenter.seconds=0.001", results="b")
    before = table("a")
    assert join("a", "b") == 2
    assert f"segmenter.seconds is 0.0 in a/{FOLDER} and 0.001 in b/{FOLDER}" in said(capsys)

    study("repeats=1", results="c")
    origin = here / "c" / FOLDER / "provenance.json"
    content = json.loads(origin.read_text())
    origin.write_text(json.dumps(content | {"algorithm_version": 99}))
    assert join("a", "c") == 2
    assert f"and 99 in c/{FOLDER}: their results cannot be compared" in said(capsys)
    origin.write_text(json.dumps(content))

    lines = [json.loads(line) for line in (here / "c" / FOLDER / "trials.jsonl").read_text().splitlines()]
    lines[1]["n_segments"] = 17
    (here / "c" / FOLDER / "trials.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert join("a", "c") == 2
    message = said(capsys)
    assert f"trial {lines[1]['trial_id']} (ant, normal_noise 0.2, repeat 0) has n_segments 2" in message
    assert "and 17 in c/" in message

    assert join("a", "a", "--into", "joined") == 0
    assert join("a", "b", "--into", "joined") == 2
    assert "joined contains results already" in said(capsys)
    assert merge.main(["a", "b"]) == 2
    message = said(capsys)
    assert "a is not the results folder of a study" in message
    assert message.rstrip().endswith(f"{Path('a') / FOLDER} is one")
    assert table("a") == before
