import numpy as np
import pytest

from studies.storage import LabelStore


def test_arrays_are_read_as_they_were_stored(tmp_path):
    arrays = {"labels": np.arange(1000) % 7, "reference_labels": np.array([], dtype=np.int32)}
    LabelStore(tmp_path).put("a1b2", arrays)
    found = LabelStore(tmp_path).get("a1b2")
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array, strict=True)


def test_a_trial_without_arrays_has_none_and_reading_creates_nothing(tmp_path):
    assert LabelStore(tmp_path / "new").get("a1b2") is None
    assert list(tmp_path.iterdir()) == []


def test_later_arrays_replace_earlier_ones(tmp_path):
    store = LabelStore(tmp_path)
    store.put("a1b2", {"labels": np.zeros(3)})
    store.put("a1b2", {"others": np.ones(2)})
    assert list(store.get("a1b2")) == ["others"]
    assert [path.name for path in (tmp_path / "labels").iterdir()] == ["a1b2.npz"]


@pytest.mark.parametrize("keep", [0, 1, 30, 100, -30, -1])
def test_a_damaged_file_counts_as_missing(tmp_path, keep):
    store = LabelStore(tmp_path)
    store.put("a1b2", {"labels": np.random.default_rng(0).integers(0, 9, 1000)})
    path = tmp_path / "labels" / "a1b2.npz"
    path.write_bytes(path.read_bytes()[:keep])
    assert store.get("a1b2") is None


def test_flipped_bytes_count_as_missing_or_do_not_matter(tmp_path):
    store = LabelStore(tmp_path)
    labels = np.random.default_rng(0).integers(0, 9, 300)
    store.put("a1b2", {"labels": labels})
    path = tmp_path / "labels" / "a1b2.npz"
    content = path.read_bytes()
    for place in range(0, len(content), 3):
        path.write_bytes(content[:place] + bytes([content[place] ^ 255]) + content[place + 1 :])
        found = store.get("a1b2")
        assert found is None or all((array == labels).all() for array in found.values())


def test_pickled_objects_are_not_read(tmp_path):
    (tmp_path / "labels").mkdir()
    np.savez(tmp_path / "labels" / "a1b2.npz", labels=np.array([{}], dtype=object))
    assert LabelStore(tmp_path).get("a1b2") is None
