from importlib import metadata

import heatwalk
from studies.storage.provenance import commit, provenance


def test_it_names_the_versions_of_all_that_computes_results():
    found = provenance({"ant": "0123"}, "python -m studies.run +study=holes")
    for package in ("numpy", "scipy", "numba", "llvmlite", "trimesh", "pymeshlab", "pandas"):
        assert found["packages"][package] == metadata.version(package)
    assert found["algorithm_version"] == heatwalk.ALGORITHM_VERSION
    assert found["meshes_sha256"] == {"ant": "0123"}
    assert found["command"] == "python -m studies.run +study=holes"


def test_a_checkout_has_a_commit_and_something_else_none(monkeypatch, tmp_path):
    assert commit() is None or len(commit().removesuffix("+changes")) == 40
    monkeypatch.setenv("GIT_DIR", str(tmp_path))
    assert commit() is None
