"""The status of every stored trial, in little memory."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from studies.planning.trial_ids import TrialIds

PACKED_FROM = 200_000  # entries of the dict that are packed, at least


class Statuses(MutableMapping[str, str]):
    """What became of trials: trial_id -> "ok", "failed", "timeout" or "crashed", in the order in which they came first.

    The latest ones are in a dict; when it has grown to a quarter of the others, they are packed: 13 bytes each, and
    what it takes to find them.

    Examples
    --------
    >>> statuses = Statuses()
    >>> statuses["a"] = "ok"
    >>> statuses.of(TrialIds(["b", "a"])).tolist(), statuses
    ([-1, 0], {'a': 'ok'})
    """

    def __init__(self) -> None:
        self._names: list[str] = ["ok"]
        self._ids = TrialIds()
        self._codes: NDArray[np.int16] = np.zeros(0, np.int16)
        self._latest: dict[str, str] = {}
        self._n_changed = 0  # of the latest, those that replace a packed one

    def of(self, ids: TrialIds) -> NDArray[np.int16]:
        """(n,) 0 for "ok", 1 and above for trials that failed, -1 for those that are not stored."""
        positions = self._ids.positions(ids)
        known = positions >= 0
        codes = np.full(len(ids), -1, np.int16)
        codes[known] = self._codes[positions[known]]
        if self._latest:
            latest = list(self._latest)
            at = TrialIds(latest).positions(ids)
            found = at >= 0
            values = np.array([self._code(self._latest[each]) for each in latest], np.int16)
            codes[found] = values[at[found]]
        return codes

    def add(self, ids: TrialIds, statuses: list[str]) -> None:
        """Note many trials."""
        if ids.packed is None or len(ids) < PACKED_FROM // 100:
            for trial_id, status in zip(ids, statuses, strict=True):
                self[trial_id] = status
            return
        self._pack()
        self._append(ids, statuses)

    def __getitem__(self, trial_id: str) -> str:
        if trial_id in self._latest:
            return self._latest[trial_id]
        position = self._ids.position(trial_id)
        if position < 0:
            raise KeyError(trial_id)
        return self._names[self._codes[position]]

    def __setitem__(self, trial_id: str, status: str) -> None:
        if trial_id not in self._latest and len(self._ids):
            self._n_changed += trial_id in self._ids
        self._latest[trial_id] = status
        if len(self._latest) >= max(PACKED_FROM, len(self._ids) // 4):
            self._pack()

    def __delitem__(self, trial_id: str) -> None:
        raise TypeError("rows are never taken back")

    def __iter__(self) -> Iterator[str]:
        if not self._n_changed:
            return chain(self._ids, self._latest)
        return chain(self._ids, (each for each in self._latest if each not in self._ids))

    def __len__(self) -> int:
        return len(self._ids) + len(self._latest) - self._n_changed

    def __repr__(self) -> str:
        return repr(dict(self))

    def _code(self, status: str) -> int:
        if status not in self._names:
            self._names.append(status)
        return self._names.index(status)

    def _pack(self) -> None:
        latest, self._latest, self._n_changed = self._latest, {}, 0
        if latest:
            self._append(TrialIds(latest), list(latest.values()))

    def _append(self, ids: TrialIds, statuses: list[str]) -> None:
        """Pack further ones, of which later ones replace earlier ones and those that are packed."""
        code_of = {status: self._code(status) for status in set(statuses)}
        codes = np.array([code_of[status] for status in statuses], np.int16)
        packed = self._ids.positions(ids)
        known = packed >= 0
        self._codes[packed[known]] = codes[known]
        new, codes = ids.at(~known), codes[~known]
        last = new.positions(new)
        first = np.unique(last, return_index=True)[1]
        first.sort()
        self._ids = TrialIds.joined([self._ids, new.at(first)])
        self._codes = np.concatenate([self._codes, codes[last[first]]])
