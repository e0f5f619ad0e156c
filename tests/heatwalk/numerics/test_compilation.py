"""What is compiled, when, and who is told."""

import importlib
import os
import subprocess
import sys
import time

import numpy as np
import pytest

from heatwalk.numerics.compilation import announced, compiled, seconds_compiled
from heatwalk.segmentation import compile_ahead, segment, segment_at_times
from tests.helpers.meshes import bundled

KERNELS = [f"heatwalk.numerics.{name}" for name in ("cholesky", "dissection", "lanczos", "search", "triangles")]


def new_function():
    """A function that no cache can contain."""
    namespace = {}
    exec(f"def add(a, b): return a + b + {time.time_ns()}", namespace)
    return compiled(namespace["add"])


def versions():
    """How many argument types each kernel is compiled for in this process."""
    modules = map(importlib.import_module, KERNELS)
    return {
        f"{module.__name__}.{name}": len(value.signatures)
        for module in modules
        for name, value in vars(module).items()
        if hasattr(value, "signatures")
    }


def test_compiling_is_announced_once_and_its_time_is_counted():
    said, before = [], seconds_compiled()
    function = new_function()
    with announced(lambda: said.append("compiling")):
        assert function(1, 2) > 3
        assert function(1.5, 2) > 3  # compiled for floats too
    assert said == ["compiling"]
    assert seconds_compiled() > before


def test_nothing_is_announced_for_what_is_compiled_already():
    function = new_function()
    function(1, 2)
    said, before = [], seconds_compiled()
    with announced(lambda: said.append("compiling")):
        function(3, 4)
    assert (said, seconds_compiled()) == ([], before)


def test_an_announcement_that_raises_prevents_the_compilation():
    function = new_function()

    def refuse():
        raise InterruptedError

    with pytest.raises(InterruptedError), announced(refuse):
        function(1, 2)
    assert not function.signatures
    assert function(1, 2) > 3


def test_compiling_ahead_leaves_nothing_to_compile():
    compile_ahead()
    before, seconds = versions(), seconds_compiled()
    mesh = bundled("cow")
    result = segment(mesh.vertices, mesh.faces, 0.3)
    assert versions() == before
    assert seconds_compiled() == seconds
    assert result.seconds["compilation"] == 0


def test_no_kernel_is_compiled_for_several_types():
    code = (
        "from tests.heatwalk.numerics.test_compilation import *; compile_ahead(); m = bundled('cow');"
        "segment(m.vertices, m.faces); print({name: n for name, n in versions().items() if n > 1})"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    # Only the copy of a panel, which is there in both memory orders.
    assert eval(out) in ({}, {"heatwalk.numerics.cholesky._copy": 2})


def test_the_stages_do_not_contain_the_time_of_compiling(monkeypatch):
    mesh = bundled("ant")
    compile_ahead()
    alone = next(segment_at_times(mesh.vertices, mesh.faces, [1.0])).seconds
    ticks, compiled_ticks = (iter(np.arange(1000) * step) for step in (10.0, 4.0))
    monkeypatch.setattr("heatwalk.segmentation.clock.perf_counter", lambda: next(ticks))
    monkeypatch.setattr("heatwalk.numerics.compilation.seconds_compiled", lambda: next(compiled_ticks))
    seconds = segment(mesh.vertices, mesh.faces).seconds
    assert seconds.keys() == alone.keys()
    # Each stage took ten seconds by this clock, four of which were compilation; the spectrum has two parts.
    assert seconds == {"compilation": 20, "operator": 6, "spectrum": 12, "walk": 6, "dissipators": 6}


@pytest.mark.slow
def test_the_first_segmentation_of_a_user_says_that_it_compiles(tmp_path):
    mesh = bundled("ant")
    path = tmp_path / "ant.off"
    path.write_text(
        f"OFF\n{len(mesh.vertices)} {len(mesh.faces)} 0\n"
        + "".join("{} {} {}\n".format(*v) for v in mesh.vertices.tolist())
        + "".join("3 {} {} {}\n".format(*f) for f in mesh.faces.tolist())
    )
    command = [sys.executable, "-c", "from heatwalk.cli import main; main()", "segment", path.name]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    first, second = (
        subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
        for _ in range(2)
    )
    assert first.stderr == "heatwalk: compiling, which takes about half a minute, once\n"
    assert "seconds: compilation" in first.stdout
    assert second.stderr == ""
    assert "seconds: operator" in second.stdout
