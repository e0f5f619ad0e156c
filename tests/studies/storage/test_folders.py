from studies.storage import LabelStore, RowStore, StoredRows, result_folders
from tests.studies.storage.example_rows import row


def test_earlier_results_are_moved_and_those_of_other_studies_below_are_not(tmp_path):
    folder = tmp_path / "psb"
    for path in (folder, folder / "segmenter.time=2"):
        with RowStore(path) as store:
            store.add(row("a"))
    LabelStore(folder).put("a", {"labels": [0, 1]})
    with RowStore(folder, fresh=True) as store:
        assert store.status == {}
        assert LabelStore(folder).get("a") is None
    assert StoredRows(store.moved_to).status == StoredRows(folder / "segmenter.time=2").status == {"a": "ok"}
    assert LabelStore(store.moved_to).get("a")["labels"].tolist() == [0, 1]
    assert store.moved_to.parent == tmp_path
    assert result_folders(tmp_path) == [folder, folder / "segmenter.time=2"]


def test_a_new_folder_has_no_earlier_results(tmp_path):
    with RowStore(tmp_path / "new", fresh=True) as store:
        assert store.moved_to is None
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


def test_results_are_found_below_and_at_the_folder_itself(tmp_path):
    assert result_folders(tmp_path) == result_folders(tmp_path / "absent") == []
    for name in ("b", "a/c", "."):
        (tmp_path / name).mkdir(parents=True, exist_ok=True)
        (tmp_path / name / "trials.parquet").touch()
    assert result_folders(tmp_path) == [tmp_path, tmp_path / "a" / "c", tmp_path / "b"]
