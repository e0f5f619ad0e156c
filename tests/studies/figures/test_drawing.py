import numpy as np
import pandas as pd
import pytest
from PIL import Image

from studies.figures import curves as figures


def table(perturbation, levels, paper):
    mean = np.linspace(1.0, 5.0, len(levels))
    return pd.DataFrame(
        {
            "part": perturbation, "level": levels, "unit": "count", "mean": mean, "ci_low": mean - 0.5,
            "ci_high": mean + 1, "median": mean - 0.2, "paper": paper,
        }
    )  # fmt: skip


def draw_curve():
    levels = [1.0, 2.0, 4.0]
    rows = pd.DataFrame([{"model": str(m), "level": x, "change_percentage": m + x} for m in range(12) for x in levels])
    return figures.curve(table("holes", levels, [2.0, np.nan, 3.0]), rows, "holes", "Holes")


def draw_panels():
    parts = [table("short_circuits", [10.0], [2.32]), table("holes", [58.0, 250.0], np.nan)]
    named = {"short_circuits": ("Short circuits", "tubes"), "holes": ("Holes", "removed")}
    return figures.panels(pd.concat(parts), named, "Table 2")


def draw_times():
    rows = [
        {"model": m, "level": t, "unit": "paper", "n_segments": 4 + m % 2 * (t > 1)}
        for m in range(4)
        for t in (0.5, 1.0, 1.5, 4.0)
    ]
    return figures.times(pd.DataFrame(rows), [(0.6, 2.7), (0.85, 1.9)], "Times")


def draw_matrix():
    change = pd.DataFrame([[0.0, 3.0], [3.0, 0.0]], index=["cat0", "cat1"], columns=["cat0", "cat1"])
    return figures.matrix({"cat": change, "dog": change}, "Poses")


def draw_methods():
    scores = pd.DataFrame({"method": ["HeatWalk", "Humans", "HeatWalk"], "source": ["computed", "paper", "paper"]})
    for metric in ("hamming", "gce"):
        scores = scores.assign(**{metric: 0.2, f"{metric}_low": [0.1, np.nan, np.nan], f"{metric}_high": 0.3})
    return figures.methods(scores, {"hamming": "HD", "gce": "GCE"}, "Table 1")


@pytest.mark.parametrize("draw", [draw_curve, draw_panels, draw_times, draw_matrix, draw_methods])
def test_a_curve_is_a_pdf_and_a_png_of_300_dpi_with_the_same_bytes_again(draw, tmp_path):
    figures.save(draw(), tmp_path / "first.png")
    figures.save(draw(), tmp_path / "second.png")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first.pdf", "first.png", "second.pdf", "second.png"]
    for suffix in ("pdf", "png"):
        assert (tmp_path / f"first.{suffix}").read_bytes() == (tmp_path / f"second.{suffix}").read_bytes()
    with Image.open(tmp_path / "first.png") as image:
        assert round(image.info["dpi"][0]) == 300
        assert image.width <= 300 * figures.TWO_COLUMNS


def test_a_grid_crops_the_pictures_of_a_row_alike_and_keeps_all_their_ink():
    picture, other = np.full((60, 80, 3), 255, dtype=np.uint8), np.full((60, 80, 3), 255, dtype=np.uint8)
    picture[10:20, 30:40] = 0
    other[40:50, 60:70] = 0
    figure, axes = figures.grid([[(picture, "one"), (other, "two")]], "heading")
    shown = [axis.get_images()[0].get_array() for axis in axes[0]]
    assert [image.shape for image in shown] == [(40, 40, 3), (40, 40, 3)]
    assert [int((image == 0).all(axis=2).sum()) for image in shown] == [100, 100]
    assert figure.get_figwidth() <= figures.TWO_COLUMNS


@pytest.mark.parametrize("levels", [[0.1, 0.25, 0.5, 0.75], [0.75, 0.5, 0.25, 0.1]])
def test_every_level_that_has_room_has_its_number(levels):
    rows = pd.DataFrame([{"model": "m", "level": level, "change_percentage": 1.0} for level in levels])
    (axes,) = figures.curve(table("decimation", levels, np.nan), rows, "kept", "Decimation").axes
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0.1", "0.25", "0.5", "0.75"]


@pytest.mark.filterwarnings("error")
def test_a_study_of_which_every_trial_failed_has_room_for_the_papers_points(tmp_path):
    levels = [0.1, 0.5]
    rows = pd.DataFrame([{"model": "m", "level": level, "change_percentage": np.nan} for level in levels])
    nothing = table("holes", levels, [2.0, 7.0]).assign(mean=np.nan, ci_low=np.nan, ci_high=np.nan)
    figure = figures.curve(nothing, rows, "holes", "Holes")
    figures.save(figure, tmp_path / "failed.png")
    (axes,) = figure.axes
    assert axes.get_ylim()[1] >= 7
    assert "mean, 95 % interval (0 models)" in axes.get_legend_handles_labels()[1]


def test_a_picture_drawn_in_proportion_keeps_a_dot_of_the_smallest_scale():
    shrunk = figures._shrunk(np.zeros((90, 120, 3), np.uint8), 1e-6)
    assert shrunk.shape == (90, 120, 3)
    assert (shrunk < 255).any(axis=2).sum() == 1
