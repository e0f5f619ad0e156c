"""Inputs with troubles that people have reported, and the right answer of each."""

from pathlib import Path

import numpy as np
import pytest

import heatwalk
from heatwalk.cli import main
from heatwalk.meshes import face_areas

CASES = Path(__file__).parents[3] / "shared" / "cases"
PYRAMID = (5, 6, 14.3195)
RIGHT = {
    "dart1.off": (4, 2, 6),
    "U0.obj": (8, 6, 7),
    "mixed_aligned_int.ply": (10, 8, 5),
    "b_little_quads.ply": PYRAMID,
    "bs_usemtl_before_f.obj": PYRAMID,
    "vt_u2028.obj": PYRAMID,
    "cont_space.obj": PYRAMID,
    "blank_after_header.ply": PYRAMID,
    "comment_before_format.ply": PYRAMID,
    "cr_a.ply": PYRAMID,
    "trail1.stl": PYRAMID,
    "name_vertex.stl": PYRAMID,
    "tokens_freeform.off": PYRAMID,
    "lower.off": PYRAMID,
}


def case(name):
    if not (CASES / name).exists():
        pytest.skip(f"the case is not at hand: no {CASES / name}")
    return CASES / name


@pytest.mark.parametrize("name", RIGHT)
def test_a_file_has_the_right_vertices_triangles_and_area(name):
    mesh = heatwalk.read_mesh(case(name))
    n_vertices, n_faces, area = RIGHT[name]
    assert (len(mesh.vertices), len(mesh.faces)) == (n_vertices, n_faces)
    assert face_areas(mesh.vertices, mesh.faces).sum() == pytest.approx(area, rel=1e-5)


@pytest.mark.parametrize(
    ("name", "note", "weld", "n_welded"),
    [
        ("neartol.stl", "18 of 18 vertices nearly coincide with another one", 1e-5, 5),
        ("split_at_seams.ply", "288 of 792 vertices coincide exactly with another one", "exact", 642),
    ],
)
def test_an_unwelded_mesh_is_segmented_as_it_is_with_a_note(name, note, weld, n_welded, tmp_path, capsys):
    output = tmp_path / "out.ply"
    assert main(["segment", str(case(name)), "--output", str(output)]) == 0
    printed = capsys.readouterr().out
    assert f"  note: {note}" in printed
    assert f"(--weld {weld})" in printed.replace("1e-05", f"{1e-5}")
    mesh = heatwalk.read_mesh(case(name))
    assert len(heatwalk.read_mesh(output).vertices) == len(mesh.vertices)
    assert len(heatwalk.read_mesh(case(name), weld=weld).vertices) == n_welded


def test_a_mesh_at_map_coordinates_is_written_as_it_is(tmp_path):
    mesh = heatwalk.read_mesh(case("utm.obj"))
    assert main(["segment", str(case("utm.obj")), "--output", str(tmp_path / "out.ply")]) == 0
    written = heatwalk.read_mesh(tmp_path / "out.ply")
    assert face_areas(written.vertices, written.faces).sum() == pytest.approx(100.5, abs=0.05)
    edges = mesh.vertices[mesh.faces] - mesh.vertices[np.roll(mesh.faces, 1, axis=1)]
    moved = np.linalg.norm(written.vertices - mesh.vertices, axis=1).max()
    assert moved <= 1e-3 * np.linalg.norm(edges, axis=2).min()
