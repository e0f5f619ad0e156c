import itertools

import numpy as np
import pandas as pd
import pytest

from studies.statistics.severity import areas, cell_values, common_cells, corruption_errors, part_means


def random_rows(seed=0, methods="abc", parts=("holes", "noise"), n_levels=5, n_models=3, n_repeats=2):
    """Trials with random values, of which some failed."""
    rng = np.random.default_rng(seed)
    keys = itertools.product(methods, parts, range(n_levels), range(n_models), range(n_repeats))
    rows = pd.DataFrame(keys, columns=["segmenter", "part", "level", "model", "repeat"])
    rows["model"] = "m" + rows["model"].astype(str)
    rows["status"] = np.where(rng.random(len(rows)) < 0.1, "failed", "ok")
    rows["value"] = np.where(rows["status"] == "ok", rng.uniform(0, 100, len(rows)), np.nan)
    return rows.sample(frac=1, random_state=seed).reset_index(drop=True)


def by_loops(rows, method, part):
    """The sum over strengths of the mean over models of the mean over repeats, of which those that failed count 200."""
    total = 0.0
    for level in set(rows["level"]):
        of_models = []
        for model in set(rows["model"]):
            of_repeats = []
            for row in rows.to_dict("records"):
                if (row["segmenter"], row["part"], row["level"], row["model"]) == (method, part, level, model):
                    of_repeats.append(row["value"] if row["status"] == "ok" else 200.0)
            of_models.append(sum(of_repeats) / len(of_repeats))
        total += sum(of_models) / len(of_models)
    return total


def test_a_corruption_error_is_the_ratio_of_two_sums_over_strengths():
    rows = random_rows()
    errors = corruption_errors(cell_values(rows, "value", 200), "b")
    for method, part in itertools.product("abc", ("holes", "noise")):
        expected = by_loops(rows, method, part) / by_loops(rows, "b", part)
        assert errors.loc[method, part] == pytest.approx(expected, rel=1e-12)


def test_the_sums_of_models_add_up_to_the_corruption_errors():
    cells = cell_values(random_rows(1), "value", 200)
    sums = areas(cells).sum(axis=2)
    reference = list(cells.index).index("a")
    np.testing.assert_allclose(sums / sums[reference], corruption_errors(cells, "a").to_numpy(), rtol=1e-12)


def test_a_method_without_a_cell_is_compared_with_the_reference_on_the_others():
    rows = random_rows(2, n_repeats=1)
    lacks = (rows["segmenter"] == "c") & (rows["model"] == "m1") & (rows["part"] == "holes")
    errors = corruption_errors(cell_values(rows[~lacks], "value", 200), "a")
    of_others = corruption_errors(cell_values(rows[rows["model"] != "m1"], "value", 200), "a")
    of_all = corruption_errors(cell_values(rows, "value", 200), "a")
    assert errors.loc["c", "holes"] == pytest.approx(of_others.loc["c", "holes"])
    assert errors.loc["c", "noise"] == pytest.approx(of_all.loc["c", "noise"])
    pd.testing.assert_series_equal(errors.loc["b"], of_all.loc["b"])


def test_there_is_no_corruption_error_where_the_reference_does_not_change_or_is_not_there():
    rows = random_rows(3)
    rows.loc[(rows["segmenter"] == "a") & (rows["part"] == "holes"), ["value", "status"]] = [0.0, "ok"]
    errors = corruption_errors(cell_values(rows, "value", 200), "a")
    assert errors["holes"].isna().all()
    assert errors["noise"].notna().all()
    assert corruption_errors(cell_values(rows, "value", 200), "nobody").isna().all(axis=None)


def test_cells_that_fewer_than_half_of_the_methods_have_are_left_out():
    rows = random_rows(4, methods="abcd", n_repeats=1)
    only_one = (rows["model"] == "m2") & (rows["segmenter"] != "a")
    half = (rows["model"] == "m1") & rows["segmenter"].isin(["a", "b"])
    cells = common_cells(cell_values(rows[~only_one & ~half], "value", 200))
    assert set(cells.columns.get_level_values(2)) == {"m0", "m1"}


def test_the_mean_of_a_part_leaves_out_what_was_not_run():
    rows = random_rows(5, n_repeats=1)
    cells = cell_values(rows[(rows["segmenter"] != "c") | (rows["level"] == 0)], "value", 200)
    of_c = cells.loc["c"].dropna()
    expected = [of_c[[key for key in of_c.index if key[0] == part]].mean() for part in ("holes", "noise")]
    assert part_means(cells).loc["c", ["holes", "noise"]].to_list() == pytest.approx(expected)
