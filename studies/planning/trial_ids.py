"""Many trial_ids in little memory: 12 bytes each instead of a text of 24 characters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import chain, islice
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

WIDTH = 12  # bytes of an id, which is shown as twice as many hexadecimal digits
_IS_DIGEST = re.compile(r"[0-9a-f]{24}").fullmatch
_MANY = 1_000_000  # ids that are converted or looked up at the same time


class TrialIds(Sequence[str]):
    """An immutable sequence of trial_ids that tells quickly which of many others it contains.

    Ids that are no digests, as those of tests, are kept as they are.

    Parameters
    ----------
    ids : iterable of str

    Examples
    --------
    >>> ids = TrialIds(["8f997a0c7d020d2881ec7a92", "00997a0c7d020d2881ec7a92"])
    >>> list(ids), ids.positions(TrialIds(["00997a0c7d020d2881ec7a92", "ff997a0c7d020d2881ec7a92"])).tolist()
    (['8f997a0c7d020d2881ec7a92', '00997a0c7d020d2881ec7a92'], [1, -1])
    """

    def __init__(self, ids: Iterable[str] = ()) -> None:
        self._texts: list[str] | None = None
        self._packed: NDArray[np.uint8] = np.zeros((0, WIDTH), np.uint8)
        packed, ids = bytearray(), iter(ids)
        while batch := list(islice(ids, _MANY)):
            if not all(map(_IS_DIGEST, batch)):
                self._texts = [*_texts_of(packed), *batch, *ids]
                return
            packed += bytes.fromhex("".join(batch))
        self._packed = _as_rows(packed)

    @classmethod
    def of_bytes(cls, packed: Any) -> TrialIds:
        """Ids from the bytes of their digests, one behind the other; they are not copied."""
        ids = cls()
        ids._packed = _as_rows(packed)
        return ids

    @classmethod
    def of_lines(cls, text: bytes) -> TrialIds:
        """Ids that are lines of a text in ASCII.

        Raises
        ------
        UnicodeDecodeError
            If it is not ASCII.
        """
        size = 2 * WIDTH + 1
        if len(text) % size == 0:
            lines = np.frombuffer(text, np.uint8).reshape(-1, size)
            ids = cls.of_digits(lines[:, :-1]) if (lines[:, -1] == ord("\n")).all() else None
            if ids is not None:
                return ids
        return cls(text.decode("ascii").splitlines())

    @classmethod
    def of_digits(cls, digits: NDArray[np.uint8]) -> TrialIds | None:
        """Ids from (n, 24) characters; None if some of them are no digests."""
        packed = bytearray()
        for start in range(0, len(digits), _MANY):
            block = digits[start : start + _MANY]
            is_decimal = (block >= ord("0")) & (block <= ord("9"))
            if not (is_decimal | ((block >= ord("a")) & (block <= ord("f")))).all():
                return None
            packed += bytes.fromhex(block.tobytes().decode("ascii"))
        return cls.of_bytes(packed)

    @classmethod
    def joined(cls, parts: Iterable[TrialIds]) -> TrialIds:
        """The ids of several, one after the other."""
        parts = [part for part in parts if len(part)]
        if any(part._texts is not None for part in parts):
            return cls(chain.from_iterable(parts))
        return cls.of_bytes(np.concatenate([part._packed for part in parts]) if parts else b"")

    @property
    def packed(self) -> NDArray[np.uint8] | None:
        """(n, 12) the bytes of the digests; None if the ids are no digests."""
        return self._packed if self._texts is None else None

    def __len__(self) -> int:
        return len(self._packed) if self._texts is None else len(self._texts)

    def __iter__(self) -> Iterator[str]:
        if self._texts is not None:
            yield from self._texts
            return
        for start in range(0, len(self._packed), _MANY // 10):
            yield from _texts_of(self._packed[start : start + _MANY // 10])

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> TrialIds: ...

    def __getitem__(self, index: int | slice) -> str | TrialIds:
        if isinstance(index, slice):
            return self.at(np.arange(len(self))[index])
        return self._packed[index].tobytes().hex() if self._texts is None else self._texts[index]

    def at(self, where: NDArray[Any]) -> TrialIds:
        """The ids at positions, or where a mask is true."""
        if self._texts is None:
            return self.of_bytes(self._packed[where])
        positions = np.flatnonzero(where) if where.dtype == bool else where
        return TrialIds(self._texts[i] for i in positions)

    def __contains__(self, trial_id: object) -> bool:
        return isinstance(trial_id, str) and self.position(trial_id) >= 0

    def position(self, trial_id: str) -> int:
        """The position of an id; -1 if it is absent."""
        return int(self.positions(TrialIds([trial_id]))[0])

    def contain(self, others: TrialIds) -> NDArray[np.bool_]:
        """(n,) which of other ids are among these."""
        return self.positions(others) >= 0

    def positions(self, others: TrialIds) -> NDArray[np.int64]:
        """(n,) the position of each of other ids, the last one of an id that occurs again; -1 where it is absent."""
        if self._texts is not None or others._texts is not None:
            position = self._position_of_text
            return np.array([position.get(each, -1) for each in others], dtype=np.int64)
        found = np.full(len(others), -1, dtype=np.int64)
        for start in range(0, len(others) if len(self) else 0, _MANY):
            found[start : start + _MANY] = self._positions(others._packed[start : start + _MANY])
        return found

    def lines(self) -> Iterator[bytes]:
        """The ids as lines of ASCII, many of them at a time."""
        ids = iter(self)
        while batch := list(islice(ids, _MANY // 10)):
            yield "".join(f"{each}\n" for each in batch).encode("ascii")

    @cached_property
    def _position_of_text(self) -> dict[str, int]:
        return {trial_id: i for i, trial_id in enumerate(self)}

    @cached_property
    def _sorted(self) -> tuple[NDArray[np.uint64], NDArray[np.uint32]]:
        """The first eight bytes of each id as a number, sorted, and the positions that they have in the sequence."""
        starts = _starts(self._packed)
        order = np.argsort(starts, kind="stable").astype(np.uint32)
        return starts[order], order

    def _positions(self, others: NDArray[np.uint8]) -> NDArray[np.int64]:
        starts, order = self._sorted
        wanted = _starts(others)
        by_value = np.argsort(wanted)  # neighbours in memory are looked up one after the other
        at = np.empty(len(others), np.int64)
        at[by_value] = np.searchsorted(starts, wanted[by_value], side="right") - 1
        found = np.full(len(others), -1, dtype=np.int64)
        left = np.flatnonzero((at >= 0) & (starts[at] == wanted))
        while len(left):  # again for ids that have the same first eight bytes as another
            candidates = order[at[left]]
            same = (self._packed[candidates] == others[left]).all(axis=1)
            found[left[same]] = candidates[same]
            left = left[~same]
            at[left] -= 1
            left = left[(at[left] >= 0) & (starts[at[left]] == wanted[left])]
        return found


def _as_rows(packed: Any) -> NDArray[np.uint8]:
    return np.frombuffer(packed, np.uint8).reshape(-1, WIDTH)


def _starts(packed: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """The first eight bytes of each id as a number."""
    return np.ascontiguousarray(packed[:, :8]).view(">u8").ravel().astype(np.uint64)


def _texts_of(packed: Any) -> list[str]:
    digits = bytes(packed).hex()
    return [digits[i : i + 2 * WIDTH] for i in range(0, len(digits), 2 * WIDTH)]
