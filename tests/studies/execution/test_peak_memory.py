import threading

import numpy as np
import pytest

from studies.execution import peak_memory as module
from studies.execution.peak_memory import peak_memory

MB = 1_000_000


def allocate(megabytes):
    """An array whose pages are all in use."""
    return np.ones(megabytes * MB, dtype=np.uint8)


@pytest.fixture(params=["mark of the kernel", "samples"])
def way(request, monkeypatch):
    """Both ways of measuring; the first one only where the system has it."""
    if request.param == "samples":
        monkeypatch.setattr(module, "_reset_mark", lambda: None)
    elif module._reset_mark() is None:
        pytest.skip("this system keeps no mark that can be reset")
    return request.param


def test_memory_that_a_block_takes_is_measured(way):
    with peak_memory() as memory:
        kept = allocate(80)
    assert 80 * 0.95 < memory.megabytes < 80 * 1.2
    del kept


def test_memory_that_was_used_before_does_not_count(way):
    before = allocate(80)
    with peak_memory() as memory:
        assert before[0] == 1
    assert memory.megabytes < 10


def test_the_peak_counts_that_is_over_when_the_block_ends():
    if module._reset_mark() is None:
        pytest.skip("this system keeps no mark that can be reset")
    with peak_memory() as memory:
        allocate(80)  # freed at once
    assert 80 * 0.95 < memory.megabytes < 80 * 1.2
    with peak_memory() as memory:
        allocate(1)
    assert memory.megabytes < 10


def test_memory_that_was_freed_before_is_not_taken_for_used():
    if module._reset_mark() is None:
        pytest.skip("this system keeps no mark that can be reset")
    for _ in range(2):  # small pieces, which the C library keeps when they are freed
        with peak_memory() as memory:
            pieces = [np.ones(50_000, dtype=np.uint8) for _ in range(400)]
        assert 20 * 0.9 < memory.megabytes < 20 * 1.5
        del pieces


def test_what_a_block_raises_is_raised_and_no_thread_is_left(way):
    threads = threading.active_count()
    with pytest.raises(RuntimeError, match="no legs"), peak_memory() as memory:
        raise RuntimeError("no legs")
    assert memory.megabytes is None
    assert threading.active_count() == threads


def test_where_the_mark_cannot_be_reset_memory_is_sampled(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "_CLEAR", tmp_path / "absent" / "clear_refs")
    with peak_memory() as memory:
        kept = allocate(80)
    assert 80 * 0.95 < memory.megabytes < 80 * 1.2
    del kept
