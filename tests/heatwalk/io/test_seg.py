import re

import numpy as np
import pytest

from heatwalk.io import read_mesh, read_seg, write_seg
from heatwalk.meshes import MeshError


def test_seg_files_return_the_labels_written(tmp_path):
    labels = np.array([3, 0, 0, 12, 1])
    write_seg(tmp_path / "a.seg", labels)
    assert (tmp_path / "a.seg").read_text() == "3\n0\n0\n12\n1\n"
    assert np.array_equal(read_seg(tmp_path / "a.seg"), labels)
    assert read_seg(tmp_path / "a.seg").dtype == np.int64


def test_benchmark_segmentations_have_a_label_for_every_face_of_their_mesh(psb_root):
    off = sorted((psb_root / "data/off").glob("*.off"))[0]
    n_faces = len(read_mesh(off).faces)
    segmentations = sorted((psb_root / "data/seg/Benchmark" / off.stem).glob("*.seg"))
    assert segmentations
    for path in segmentations:
        assert np.array_equal(read_seg(path), np.loadtxt(path, dtype=int))
        assert len(read_seg(path)) == n_faces


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("0\n1\ntwo\n3\n", "line 3 is not a label (0, 1, 2 …): 'two'"),
        ("0\n-1\n", "line 2 is not a label (0, 1, 2 …): '-1'"),
        ("0\n\n1\n", "line 2 is not a label (0, 1, 2 …): ''"),
        ("0\n1 2\n", "line 2 is not a label (0, 1, 2 …): '1 2'"),
        ("0.5\n", "line 1 is not a label (0, 1, 2 …): '0.5'"),
        ("0\n99999999999999999999\n", "line 2 is not a label (0, 1, 2 …): '99999999999999999999'"),
    ],
)
def test_a_broken_seg_file_is_rejected_with_the_number_of_the_line(tmp_path, text, message):
    path = tmp_path / "a.seg"
    path.write_text(text)
    with pytest.raises(MeshError, match=re.escape(f"{path}: {message}") + "$"):
        read_seg(path)


def test_a_missing_seg_file_is_rejected(tmp_path):
    with pytest.raises(MeshError, match="No such file"):
        read_seg(tmp_path / "a.seg")
