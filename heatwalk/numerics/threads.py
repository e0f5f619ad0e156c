"""How many threads work on one mesh: results do not depend on it.

Every loop that is shared out is cut into tasks that write to places of their own, or whose results are put together in
a fixed order. So each number is the result of the same operations in the same order for any number of threads, and the
labels are equal bit for bit.

BLAS has one thread meanwhile: its matrices are small here, and its idle threads, which wait in a loop for the next
product, would take the processors from the threads that work.
"""

import contextlib
import operator
import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextvars import ContextVar
from functools import cache
from itertools import count
from typing import Any, TypeVar

Result = TypeVar("Result")

# On smaller meshes, handing out the work takes as long as it saves.
LEAST_VERTICES = 20_000

# In loops over a few numbers per vertex, so many count as one vertex: a thread takes 0.1 ms to wake up.
NUMBERS_PER_VERTEX = 75

# Pieces of a loop per thread: the threads may not be equally fast, nor the pieces equally long.
PIECES_PER_THREAD = 4


class _Workers:
    """The threads of one call, started when there is something to share out."""

    def __init__(self, number: int | None) -> None:
        self._number = number
        self._pool: ThreadPoolExecutor | None = None

    @property
    def number(self) -> int:
        """How many threads, at least 1."""
        if self._number is None:
            self._number = available_threads()
        return self._number

    @property
    def pool(self) -> ThreadPoolExecutor:
        """As many threads, without BLAS threads of their own (where BLAS uses OpenMP, limits are per thread)."""
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.number, "heatwalk", _limit_blas)
        return self._pool

    def stop(self) -> None:
        """End the threads once they have done what they are at."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)


# The threads that the current call may use; none within one of these threads, and outside `working_threads`.
_workers: ContextVar[_Workers | None] = ContextVar("heatwalk_threads", default=None)

# The vertices of the smallest mesh on which to share work.
_least_shared: ContextVar[int] = ContextVar("heatwalk_least_shared", default=LEAST_VERTICES)


@contextlib.contextmanager
def working_threads(number: int | None) -> Iterator[None]:
    """Within this ``with`` statement, `shared` uses so many threads, and BLAS one.

    Parameters
    ----------
    number : int or None
        at least 1; None for `available_threads`

    Raises
    ------
    ValueError
        if the number is not a positive integer

    Examples
    --------
    >>> with working_threads(2):
    ...     shared(abs, [-1, -2])
    [1, 2]
    """
    number = checked(number)
    with one_blas_thread():
        workers = _Workers(number)
        before = _workers.set(workers)
        try:
            yield
        finally:
            _workers.reset(before)
            workers.stop()


def with_threads(number: int | None, function: Callable[..., Result], *arguments: Any) -> Result:
    """``function(*arguments)`` within `working_threads`."""
    with working_threads(number):
        return function(*arguments)


def checked(number: int | None) -> int | None:
    """The number of threads as an int, or None; ValueError if it is not positive."""
    if number is None:
        return None
    try:
        value = operator.index(number)
    except TypeError:
        value = 0
    if value < 1:
        raise ValueError(f"threads must be a positive integer, or None for all processors, got {number!r}")
    return value


def available_threads() -> int:
    """The threads of a call that is not told how many.

    Returns
    -------
    int
        the first number of the environment variable ``OMP_NUM_THREADS`` if that is set, as schedulers of clusters do;
        otherwise the processors that this process may use, by its affinity and the limits of its container

    Examples
    --------
    >>> available_threads() >= 1
    True
    """
    limit = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0].strip()
    if limit.isdecimal() and int(limit) > 0:
        return int(limit)
    import loky  # not above: it takes longer to import than small meshes to segment

    return loky.cpu_count()


def number_of_threads() -> int:
    """How many threads `shared` uses here."""
    workers = _workers.get()
    return 1 if workers is None else workers.number


def worth_sharing(n_vertices: int, numbers: int = NUMBERS_PER_VERTEX) -> bool:
    """Whether sharing the work on so many vertices saves more time than it costs, if there are threads for it.

    ``numbers`` is how many a loop reads per vertex; by default it does more than that.
    """
    work = min(numbers, NUMBERS_PER_VERTEX) * n_vertices
    return work >= _least_shared.get() * NUMBERS_PER_VERTEX and number_of_threads() > 1


@contextlib.contextmanager
def sharing_everything() -> Iterator[None]:
    """Within this ``with`` statement, even the work on small meshes is shared: to test and to compile it.

    Examples
    --------
    >>> with sharing_everything(), working_threads(2):
    ...     worth_sharing(1)
    True
    """
    before = _least_shared.set(0)
    try:
        yield
    finally:
        _least_shared.reset(before)


def shared(function: Callable[..., Result], *arguments: Iterable[Any]) -> list[Result]:
    """``list(map(function, *arguments))`` on the threads of the current call, which must not depend on the order.

    The function should leave Python's lock, as compiled loops and NumPy do, and each task should take much longer than
    the ten microseconds for handing it over.

    Examples
    --------
    >>> shared(pow, [2, 3], [3, 2])
    [8, 9]
    """
    tasks = list(zip(*arguments, strict=True))
    workers = _workers.get()
    if workers is None or len(tasks) < 2 or workers.number == 1:
        return [function(*task) for task in tasks]
    found: list[Any] = [None] * len(tasks)
    numbers = count()

    def work() -> None:
        while (number := next(numbers)) < len(tasks):
            found[number] = function(*tasks[number])

    helpers = [workers.pool.submit(work) for _ in range(min(workers.number, len(tasks)) - 1)]
    with _alone():  # this thread works too, and shares nothing meanwhile
        try:
            work()
        finally:
            for helper in helpers:
                helper.exception()  # waits for it
    results(helpers)
    return found


@contextlib.contextmanager
def _alone() -> Iterator[None]:
    """Within this ``with`` statement, `shared` uses this thread alone."""
    before = _workers.set(None)
    try:
        yield
    finally:
        _workers.reset(before)


def serial(function: Callable[..., Result], *arguments: Iterable[Any]) -> list[Result]:
    """The same as `shared`, by the thread that calls it."""
    return list(map(function, *arguments))


def started(function: Callable[..., Result], *arguments: Iterable[Any], into: "list[Future[Result]]") -> None:
    """Begin tasks in order, and append them to ``into``, so that each may wait for the results of those before it."""
    tasks = list(zip(*arguments, strict=True))
    workers = _workers.get()
    for task in tasks:
        if workers is None or len(tasks) < 2 or workers.number == 1:
            into.append(Future())
            into[-1].set_result(function(*task))
        else:
            into.append(workers.pool.submit(function, *task))


def spread(function: Callable[..., Iterable[tuple[Any, ...]]], *arguments: Any) -> None:
    """Call a function, and again with each tuple of arguments that it returns, in any order.

    Examples
    --------
    >>> def halve(n: int) -> list[tuple[int]]:
    ...     print(n)
    ...     return [(n // 2,)] if n > 1 else []
    >>> spread(halve, 4)
    4
    2
    1
    """
    todo = list(function(*arguments))
    workers = _workers.get()
    if not todo or workers is None or workers.number == 1:
        while todo:
            todo += function(*todo.pop())
        return
    running = {workers.pool.submit(function, *each) for each in todo}
    while running:
        done, running = wait(running, return_when=FIRST_COMPLETED)
        for more in results(done):
            running |= {workers.pool.submit(function, *each) for each in more}


def pieces(size: int, multiple: int = 1) -> list[tuple[int, int]]:
    """Bounds of about equal pieces of 0 … ``size``, each start a multiple, for `shared` with a few per thread.

    Examples
    --------
    >>> pieces(10)
    [(0, 10)]
    """
    if not worth_sharing(size):
        return [(0, size)]
    length = -(-size // (PIECES_PER_THREAD * number_of_threads() * multiple)) * multiple
    return [(start, min(start + length, size)) for start in range(0, size, length)]


def results(futures: "Iterable[Future[Result]]") -> list[Result]:
    """The results of tasks, once they are there; the error of the first of them that failed."""
    return [future.result() for future in futures]


class _BlasLimit(contextlib.ContextDecorator):
    """One BLAS thread while any call needs it; then as many as before the first of them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._calls = 0
        self._before: list[int] = []

    def __enter__(self) -> None:
        with self._lock:
            if self._calls == 0:
                self._before = [library.get_num_threads() for library in _blas()]
                _limit_blas()
            self._calls += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._calls -= 1
            if self._calls == 0:
                for library, number in zip(_blas(), self._before, strict=True):
                    _set_threads(library, number)


_blas_limit = _BlasLimit()


def one_blas_thread() -> _BlasLimit:
    """Within this ``with`` statement, or a function decorated by it, BLAS has one thread; it may be nested.

    Takes microseconds.
    The number is one for the whole process: it is set back when no call of any thread needs it any longer.
    """
    return _blas_limit


def _limit_blas() -> None:
    """Give BLAS one thread."""
    for library in _blas():
        _set_threads(library, 1)


def _set_threads(library: Any, number: int) -> None:
    """Set the number of threads of a BLAS library.

    threadpoolctl lets only one thread of Python do so, the first that did, lest several set back each other's numbers.
    Here, calls are counted instead, and may come from any thread.
    """
    getattr(library, "_real_set_num_threads", library.set_num_threads)(number)


@cache
def _blas() -> list[Any]:
    """The BLAS libraries of NumPy and SciPy; finding them takes a millisecond."""
    import scipy.linalg  # noqa: F401 (loads its own)
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas").lib_controllers
