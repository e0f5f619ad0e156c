import subprocess
import sys

import pytest

import heatwalk


def test_importing_loads_neither_scipy_nor_numba_nor_trimesh():
    code = "import sys, heatwalk; print([m for m in ('scipy', 'numba', 'trimesh') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.parametrize("name", heatwalk.__all__)
def test_every_public_name_exists_and_is_listed(name):
    assert getattr(heatwalk, name) is not None
    assert name in dir(heatwalk)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'segmnet'"):
        heatwalk.segmnet  # noqa: B018
