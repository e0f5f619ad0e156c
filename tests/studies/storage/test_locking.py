import multiprocessing
import os
import socket

import pytest

from studies.storage import LOCK_FILE, RowStore, StoreLockedError, lock_holder
from tests.studies.execution.engines import wait_for


def hold(folder, is_open):
    with RowStore(folder):
        is_open.set()
        multiprocessing.Event().wait()


@pytest.fixture
def other_process(tmp_path):
    """A process that writes to the folder."""
    context = multiprocessing.get_context("spawn")
    is_open = context.Event()
    process = context.Process(target=hold, args=(tmp_path, is_open))
    process.start()
    assert is_open.wait(120)
    yield process
    process.kill()
    process.join()


def test_a_folder_is_written_to_by_one_process_which_is_named(other_process, tmp_path):
    named = rf"process {other_process.pid} on {socket.gethostname()} since \d{{4}}-"
    with pytest.raises(StoreLockedError, match=rf"{tmp_path}: {named}.* writes to this folder"):
        RowStore(tmp_path)
    assert lock_holder(tmp_path).startswith(f"process {other_process.pid} on {socket.gethostname()} since ")


def test_a_lock_ends_with_its_process_however_that_ends(other_process, tmp_path):
    other_process.kill()
    other_process.join()
    assert lock_holder(tmp_path) is None
    with RowStore(tmp_path):
        assert lock_holder(tmp_path).startswith(f"process {os.getpid()} on")


def test_a_store_is_open_once_in_one_process_too(tmp_path):
    with RowStore(tmp_path), pytest.raises(StoreLockedError, match=f"process {os.getpid()} on"):
        RowStore(tmp_path)


def test_nothing_of_the_lock_is_left_when_the_store_is_closed(tmp_path):
    with RowStore(tmp_path) as store:
        assert lock_holder(tmp_path)
        assert (tmp_path / LOCK_FILE).exists()
    assert list(tmp_path.iterdir()) == [store.path]
    assert lock_holder(tmp_path) is None
    assert list(tmp_path.iterdir()) == [store.path]


def write_in_turn(folder, name):
    for i in range(20):
        while True:
            try:
                with RowStore(folder) as store:
                    store.add({"trial_id": f"{name}{i}", "status": "ok"})
                break
            except StoreLockedError:
                continue


def test_processes_that_write_in_turn_lose_nothing_of_each_other(tmp_path):
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=write_in_turn, args=(tmp_path, name)) for name in "ab"]
    for process in processes:
        process.start()
    wait_for(lambda: lock_holder(tmp_path) or all(process.exitcode is not None for process in processes), 120)
    for process in processes:
        process.join()
        assert process.exitcode == 0
    with RowStore(tmp_path) as store:
        assert set(store.status) == {f"{name}{i}" for name in "ab" for i in range(20)}
        assert store.damaged == 0
