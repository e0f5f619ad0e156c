"""The command that makes the interactive plates."""

import re

import numpy as np
import pytest
import trimesh
import yaml

from studies.plates import PLATES, main
from studies.reporting.html.page import stored_scenes


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "egg & spoon.off"
    trimesh.creation.icosphere(3).apply_scale([4, 1.2, 1]).export(path)
    return path


def test_every_figure_of_the_paper_has_a_plate_that_says_what_to_look_at():
    plates = yaml.safe_load(PLATES.read_text("utf-8"))
    assert [plate["figure"] for plate in plates] == list(range(1, 16))
    assert all(len(plate["look"]) > 40 for plate in plates)


def test_a_page_of_the_users_mesh_says_which_figures_it_corresponds_to(mesh, tmp_path, capsys):
    page = tmp_path / "deep" / "plates.html"
    assert main([str(mesh), "--figures", "3,14", "--output", str(page)]) == 0
    assert "written" in capsys.readouterr().out
    text = page.read_text("utf-8")
    assert re.findall(r"Corresponds to <strong>(Figure \d+)", text) == ["Figure 3", "Figure 14"]
    assert "egg &amp; spoon" in text
    assert not re.search(r"(src|href)=\"(?!data:|#)", text)
    scenes = stored_scenes(page).values["scenes"]
    assert {scene["slider"] for scene in scenes} == {"steps", "scale, factor"}
    first = int(re.findall(r'data-first="(\d+)"', text)[1])
    assert [scene["at"]["plate"].startswith("14.") for scene in scenes].index(True) == first


def test_poses_must_have_the_same_number_of_vertices(mesh, tmp_path, capsys):
    other = tmp_path / "other.off"
    trimesh.creation.icosphere(2).export(other)
    command = ["--figures", "6", "--poses", str(mesh), str(other), "--output", str(tmp_path / "a.html")]
    assert main(command) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "--poses" in line
    assert "number of vertices" in line


def test_a_file_that_is_no_mesh_is_one_line(tmp_path, capsys):
    broken = tmp_path / "broken.off"
    np.zeros(3).tofile(broken)
    assert main([str(broken), "--figures", "3", "--output", str(tmp_path / "a.html")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("figures", ["0", "16", "a", ""])
def test_figures_that_there_are_not_are_refused(figures, capsys):
    with pytest.raises(SystemExit) as exit_:
        main(["--figures", figures])
    assert exit_.value.code == 2
    assert "from 1 to 15" in capsys.readouterr().err
