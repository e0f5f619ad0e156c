"""The trials of a study, made when they are asked for: what is held of each is its id."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import groupby
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from studies.planning.trial import Trial, options_of, planned_row
from studies.planning.trial_ids import TrialIds


class Block(Sequence[Trial]):
    """Consecutive trials of a plan, such as those of one model and method."""

    @property
    @abstractmethod
    def ids(self) -> TrialIds:
        """Their ids, computed without making the trials."""

    @abstractmethod
    def trial(self, position: int) -> Trial:
        """The trial at a position."""

    def method(self, position: int) -> tuple[str, str | None]:
        """The name of the method of a trial, and its options as JSON."""
        trial = self.trial(position)
        return trial.segmenter_name, options_of(trial)

    def examples(self) -> Iterable[Trial]:
        """Trials among which there is one of every model of the block."""
        return self

    def variants(self) -> Iterable[Trial]:
        """Trials among which is the first of every model, method, part and level of the block."""
        return self

    def values(self, column: str) -> Iterable[Any]:
        """Every value that a column has in rows of the block, as far as it is known before they run."""
        return {planned_row(trial).get(column) for trial in self}

    def groups(self, positions: NDArray[np.int64]) -> Iterator[Sequence[Trial]]:
        """The trials at some positions, those with the same ``group_key`` together."""
        for _, group in groupby(map(self.trial, positions.tolist()), key=lambda trial: trial.group_key):
            yield list(group)

    @overload
    def __getitem__(self, index: int) -> Trial: ...

    @overload
    def __getitem__(self, index: slice) -> list[Trial]: ...

    def __getitem__(self, index: int | slice) -> Trial | list[Trial]:
        return self.trial(index) if isinstance(index, int) else [self.trial(i) for i in range(len(self))[index]]

    def __iter__(self) -> Iterator[Trial]:
        return map(self.trial, range(len(self)))


class ListedBlock(Block):
    """Trials that are there already.

    Parameters
    ----------
    trials : sequence of Trial
    """

    def __init__(self, trials: Sequence[Trial]) -> None:
        self._trials = trials

    def __len__(self) -> int:
        return len(self._trials)

    @property
    def ids(self) -> TrialIds:
        """Their ids."""
        return TrialIds(trial.trial_id for trial in self._trials)

    def trial(self, position: int) -> Trial:
        """The trial at a position."""
        return self._trials[position]


class Group(Sequence[Trial]):
    """Trials of a block that share what is prepared for them, made one after the other.

    Parameters
    ----------
    block : Block
    positions : (n,) int array
    """

    def __init__(self, block: Block, positions: NDArray[np.int64]) -> None:
        self._block = block
        self._positions = positions

    def __len__(self) -> int:
        return len(self._positions)

    @overload
    def __getitem__(self, index: int) -> Trial: ...

    @overload
    def __getitem__(self, index: slice) -> list[Trial]: ...

    def __getitem__(self, index: int | slice) -> Trial | list[Trial]:
        if isinstance(index, slice):
            return [self._block.trial(int(i)) for i in self._positions[index]]
        return self._block.trial(int(self._positions[index]))

    def __iter__(self) -> Iterator[Trial]:
        return (self._block.trial(int(i)) for i in self._positions)


class Plan(Sequence[Trial]):
    """The trials of a study in their order, or some of them.

    Parameters
    ----------
    blocks : iterable of Block
    ids : TrialIds, optional
        of all trials of the blocks; computed if not given
    positions : (n,) int array, optional
        which of these trials; all by default
    """

    def __init__(
        self, blocks: Iterable[Block], ids: TrialIds | None = None, positions: NDArray[np.int64] | None = None
    ) -> None:
        self._blocks: list[Block] = []
        found = []
        for block in blocks:
            self._blocks.append(block)
            if ids is None:
                found.append(block.ids)
        self._all_ids = TrialIds.joined(found) if ids is None else ids
        self._starts = np.cumsum([0, *map(len, self._blocks)])
        self._positions = positions

    @cached_property
    def ids(self) -> TrialIds:
        """The ids of the trials."""
        return self._all_ids if self._positions is None else self._all_ids.at(self._positions)

    def where(self, mask: NDArray[np.bool_]) -> Plan:
        """The trials for which a mask is true."""
        chosen = np.flatnonzero(mask)
        positions = chosen if self._positions is None else self._positions[chosen]
        return Plan(self._blocks, self._all_ids, positions)

    def of_ids(self, ids: Iterable[str]) -> dict[str, Trial]:
        """The trials with some ids that are in the plan."""
        listed = TrialIds(ids)
        return {
            trial_id: self[int(i)] for trial_id, i in zip(listed, self.ids.positions(listed), strict=True) if i >= 0
        }

    def methods(self, ids: TrialIds) -> list[tuple[str | None, str | None]]:
        """The name of the method of trials, and its options as JSON; None for trials that are not planned."""
        positions = self._all_ids.positions(ids)
        numbers = np.searchsorted(self._starts, positions, side="right") - 1
        return [
            self._blocks[number].method(position) if number >= 0 else (None, None)
            for number, position in zip(numbers.tolist(), (positions - self._starts[numbers]).tolist(), strict=True)
        ]

    def groups(self) -> Iterator[Sequence[Trial]]:
        """The trials that share what is prepared for them, group by group."""
        for block, positions in self._of_blocks():
            yield from block.groups(positions)

    def examples(self) -> Iterator[Trial]:
        """Trials among which there is one of every model."""
        for block in self._blocks:
            yield from block.examples()

    def variants(self) -> Iterator[Trial]:
        """Trials among which is the first of every model, method, part and level."""
        for block in self._blocks:
            yield from block.variants()

    def values(self, column: str) -> set[Any]:
        """The values of a column in the rows of all blocks, as far as they are known before the trials run."""
        return set().union(*(block.values(column) for block in self._blocks))

    def __len__(self) -> int:
        return len(self._all_ids) if self._positions is None else len(self._positions)

    @overload
    def __getitem__(self, index: int) -> Trial: ...

    @overload
    def __getitem__(self, index: slice) -> list[Trial]: ...

    def __getitem__(self, index: int | slice) -> Trial | list[Trial]:
        if isinstance(index, slice):
            return [self[i] for i in range(len(self))[index]]
        position = range(len(self))[index]
        if self._positions is not None:
            position = int(self._positions[position])
        number = int(np.searchsorted(self._starts, position, side="right")) - 1
        return self._blocks[number].trial(position - int(self._starts[number]))

    def __iter__(self) -> Iterator[Trial]:
        for block, positions in self._of_blocks():
            yield from map(block.trial, positions.tolist())

    def _of_blocks(self) -> Iterator[tuple[Block, NDArray[np.int64]]]:
        """Each block with the positions in it that are chosen."""
        for block, start, end in zip(self._blocks, self._starts[:-1], self._starts[1:], strict=True):
            if self._positions is None:
                yield block, np.arange(end - start)
                continue
            first, last = np.searchsorted(self._positions, (start, end))
            if first < last:
                yield block, self._positions[first:last] - start


class PlannedRows(Sequence[dict[str, Any]]):
    """What is known of the trials of a plan before they run, made row by row.

    Parameters
    ----------
    plan : Plan
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    @property
    def ids(self) -> TrialIds:
        """The ids of the trials."""
        return self._plan.ids

    def values(self, column: str) -> set[Any]:
        """The values of a column."""
        return self._plan.values(column)

    def __len__(self) -> int:
        return len(self._plan)

    def __getitem__(self, index: Any) -> Any:
        found = self._plan[index]
        return [planned_row(trial) for trial in found] if isinstance(found, list) else planned_row(found)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return map(planned_row, self._plan)
