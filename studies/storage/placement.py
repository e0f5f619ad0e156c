"""Which folder a study writes to, and whether it is the whole of what the folder contains or a part of it.

A results folder belongs to what `identity` finds in its configuration, on the same data. The same study going on (more
repeats, other levels or models) adds to it; another method, perturbation or dataset gets a folder of its own below.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from studies.planning.errors import StudyError
from studies.planning.names import folder_name
from studies.planning.plan import PlannedRows
from studies.planning.trial_ids import TrialIds
from studies.storage.folders import ROWS_FILE, TABLE_FILE, planned_ids, read_plan, result_folders, table_is_current
from studies.storage.identity import differences, identity, selection, short_digest, words
from studies.storage.records import read_config, read_provenance
from studies.storage.rows import parse_rows, read_table_columns

# What tells the trials of a folder apart, whatever code or mesh they were made with.
SLOT = ("model", "other", "segmenter", "part", "level", "repeat")
DRAW = "draw"  # what tells the variants of a folder apart that gathers rows of several methods


@dataclass(frozen=True)
class Origin:
    """What rows are made from: options, meshes, and code.

    Parameters
    ----------
    record : mapping
        the configuration, as in config.yaml
    meshes : mapping of str to str
        name of each model -> digest of its mesh
    versions : mapping of str to int or str
        name of each method -> its version
    """

    record: Mapping[str, Any]
    meshes: Mapping[str, str]
    versions: Mapping[str, int | str]

    @classmethod
    def read(cls, folder: Path) -> Origin | None:
        """What is stored about the rows of a folder; None if their configuration is missing or damaged."""
        try:
            record = read_config(folder)
        except (OSError, StudyError):
            return None
        try:
            stored = read_provenance(folder)
        except (OSError, StudyError):
            stored = {}
        meshes = stored.get("meshes_sha256")
        versions = stored.get("segmenter_versions")
        return cls(
            record,
            meshes if isinstance(meshes, Mapping) else {},
            # Earlier versions stored that of the Heat Walk alone.
            versions if isinstance(versions, Mapping) else {"HeatWalk": stored.get("algorithm_version", 1)},
        )

    def is_of(self, other: Origin) -> bool:
        """Whether rows of both belong together, but for the versions of meshes and code."""
        return identity(self.record) == identity(other.record) and self._has_data_of(other)

    def is_current(self, other: Origin) -> bool:
        """Whether rows of both were made by the same code and from the same meshes."""
        return _agree(self.meshes, other.meshes) and _agree(self.versions, other.versions)

    def _has_data_of(self, other: Origin) -> bool:
        """Whether both use the same dataset, of which each may have a part.

        The same pattern of files is the same dataset, even if a file was edited in between. With another pattern, one
        must have all files of the other. A folder or archive is known by its last name alone, and by its meshes.
        """
        a, b = (origin.record["dataset"] for origin in (self, other))
        common = self.meshes.keys() & other.meshes.keys()
        changed = {name for name in common if self.meshes[name] != other.meshes[name]}
        if "glob" in a or "glob" in b:
            if a.get("glob") == b.get("glob"):
                return True
            return not changed and len(common) == min(len(self.meshes), len(other.meshes))
        if "root" not in a:
            return True
        return not changed or (a.get("root") == b.get("root") and changed != common)


def _agree(a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    return all(a[name] == b[name] for name in a.keys() & b.keys())


@dataclass(frozen=True)
class Place:
    """Where the rows of a study go, and which rows are there already.

    Parameters
    ----------
    folder : Path
        the results folder
    others : tuple of str
        the trial_ids in the folder that the study does not plan: the study is a part of the whole then
    part : Path
        the folder for the tables and pictures of the part; the same as ``folder`` if there are no others
    replaced : int
        rows in the folder that were made with other code or from other meshes, which the study replaces
    n_new : int
        trials that the study plans and the folder does not list yet
    extent : mapping of str to (int, int)
        how many models, levels and repeats the study has, of how many in the folder and the study together
    """

    folder: Path
    others: tuple[str, ...] = ()
    part: Path = Path()
    replaced: int = 0
    n_new: int = 0
    extent: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    @property
    def is_part(self) -> bool:
        """Whether the folder has more than what the study plans."""
        return bool(self.others)


def place(
    base: Path, origin: Origin, planned: Sequence[Mapping[str, Any]], fresh: bool = False, *, gathers: bool = False
) -> Place:
    """Where a study writes.

    Parameters
    ----------
    base : Path
        the folder of the study and its dataset
    origin : Origin
        of the rows that it makes
    planned : sequence of mapping
        a row for each of its trials, with trial_id and what of ``SLOT`` is known
    fresh : bool
        whether it starts over: what its own folder contains is moved away
    gathers : bool
        whether the tables are always about every row of the folder: those of other methods or models stay and count,
        if they are of the same variants

    Returns
    -------
    Place
    """
    folder = _own_folder(base, origin)
    if fresh:
        return Place(folder, part=folder, n_new=len(planned))
    if gathers:
        return _gathering_place(folder, planned)
    owner = Origin.read(folder)
    ids = _ids_of(planned)
    listed = _listed(folder)
    n_new = len(ids) - int(np.count_nonzero(listed.contain(ids)))
    is_listed = bool(ids.contain(listed).all())
    if is_listed and (owner is None or owner.is_current(origin)):
        # No stored row needs to be compared: a trial_id tells more than a slot.
        return Place(folder, part=folder, n_new=n_new, extent=_extent(planned, ()))
    stored = [] if is_listed else _stored(folder)
    planned_slots = {} if is_listed else {_slot(row): row["trial_id"] for row in planned}
    known = set() if is_listed else set(ids)
    of_same_slots = {_slot(row): row["trial_id"] for row in stored if _slot(row) in planned_slots}
    outdated = [slot for slot, trial_id in of_same_slots.items() if trial_id not in known]
    is_current = not outdated and (owner is None or owner.is_current(origin))
    if is_current:
        others = tuple(listed.at(~ids.contain(listed)))
        part = folder / _part_name(owner, origin, ids) if others else folder
        return Place(folder, others, part, n_new=n_new, extent=_extent(planned, stored))
    if all(_slot(row) in planned_slots for row in stored):
        return Place(folder, part=folder, replaced=len(outdated), n_new=len(ids))
    # Rows of two versions are never mixed, and a part never replaces the whole.
    changed = {"version": short_digest([dict(origin.versions), sorted(origin.meshes.items())])}
    chosen = differences(selection(owner.record), selection(origin.record)) if owner else {}
    return place(folder / folder_name(words(chosen | changed)), origin, planned)


def _gathering_place(folder: Path, planned: Sequence[Mapping[str, Any]]) -> Place:
    """Where a study writes whose tables are about every row of the folder."""
    stored = _stored(folder)
    ids = {row["trial_id"] for row in planned}
    unplanned = [row for row in stored if row["trial_id"] not in ids]
    others = tuple(row["trial_id"] for row in filter(_stays(planned), unplanned))
    replaced = len(unplanned) - len(others)
    listed = set(_listed(folder))
    n_new = sum(i not in listed for i in ids)
    return Place(folder, others, folder, replaced, n_new, _extent(planned, stored))


def others_of_same_variants(
    base: Path, origin: Origin, planned: Sequence[Mapping[str, Any]]
) -> tuple[Path, tuple[str, ...]]:
    """Where another folder of results has trials of other methods with the variants of a study.

    Parameters
    ----------
    base : Path
        the folder of the study and its dataset in other results
    origin : Origin
    planned : sequence of mapping
        as in `place`

    Returns
    -------
    (Path, tuple of str)
        the folder, and the trial_ids, none if it has none
    """
    folder = _own_folder(base, origin)
    draws = {row[DRAW] for row in planned}
    slots = {_slot(row) for row in planned}
    return folder, tuple(
        row["trial_id"] for row in _stored(folder) if row.get(DRAW) in draws and _slot(row) not in slots
    )


def _stays(planned: Sequence[Mapping[str, Any]]) -> Callable[[Mapping[str, Any]], bool]:
    """Whether a stored row counts beside the planned trials: it is of none of them, and of no other variant."""
    slots = {_slot(row) for row in planned}
    draws = {_variant(row): row[DRAW] for row in planned}
    return lambda row: _slot(row) not in slots and draws.get(_variant(row), row.get(DRAW)) == row.get(DRAW)


def _variant(row: Mapping[str, Any]) -> str:
    """What tells a variant apart, whatever method segments it."""
    return _slot({**row, "segmenter": ""})


def _extent(planned: Sequence[Mapping[str, Any]], stored: Sequence[Mapping[str, Any]]) -> dict[str, tuple[int, int]]:
    """How many models, levels and repeats are planned, of how many in all."""
    found = {}
    for noun, names in (("model", ("model", "other")), ("level", ("level",)), ("repeat", ("repeat",))):
        ours = set().union(*(_values(planned, name) for name in names))
        others = set().union(*(_values(stored, name) for name in names))
        found[noun] = len(ours), len(ours | others)
    return found


def _values(rows: Sequence[Mapping[str, Any]], name: str) -> set[Any]:
    values = rows.values(name) if isinstance(rows, PlannedRows) else {row.get(name) for row in rows}
    return values - {None, ""}


def _own_folder(base: Path, origin: Origin) -> Path:
    """The folder at or below ``base`` that belongs to the origin, or a free one."""
    owner = Origin.read(base)
    if owner is None or owner.is_of(origin) or not _has_rows(base):
        return base
    for folder in result_folders(base):
        other = Origin.read(folder) if folder.parent == base else None
        if other and other.is_of(origin):
            return folder
    changed = differences(identity(owner.record), identity(origin.record))
    if not changed:
        data = {key: origin.record["dataset"].get(key) for key in ("glob", "root")}
        changed = {f"dataset.{key}": value for key, value in data.items() if value != owner.record["dataset"].get(key)}
    folder = base / folder_name(words(changed) or f"dataset-{short_digest(sorted(origin.meshes.items()))}")
    if not _has_rows(folder):
        return folder
    return folder.with_name(
        folder_name(f"{folder.name}-{short_digest([identity(origin.record), dict(origin.meshes)])}")
    )


def _has_rows(folder: Path) -> bool:
    rows = folder / ROWS_FILE
    return (folder / TABLE_FILE).exists() or (rows.exists() and rows.stat().st_size > 0)


def _part_name(owner: Origin | None, origin: Origin, ids: Iterable[str]) -> str:
    """The name of the folder for a part of the whole, after the options that choose it."""
    chosen = differences(selection(owner.record), selection(origin.record)) if owner else {}
    return folder_name(words(chosen) or f"part-{short_digest(sorted(ids))}")


def _ids_of(planned: Sequence[Mapping[str, Any]]) -> TrialIds:
    """The trial_ids of rows, each once."""
    if isinstance(planned, PlannedRows):
        return planned.ids
    return TrialIds(dict.fromkeys(row["trial_id"] for row in planned))


def _listed(folder: Path) -> TrialIds:
    """The trial_ids that the folder is about, of which some need not have run yet."""
    listed = read_plan(folder)
    return listed if listed is not None else TrialIds(row["trial_id"] for row in _stored(folder, ()))


def _stored(folder: Path, further: Sequence[str] = (*SLOT, DRAW)) -> list[dict[str, Any]]:
    """The stored rows of the folder's last plan, with the columns of ``SLOT``; none if they cannot be read."""
    names = ["trial_id", *further]
    if table_is_current(folder):
        try:
            table = read_table_columns(folder / TABLE_FILE, names)
        except (OSError, ValueError):
            return []
        if "trial_id" not in table:
            return []
        return [dict(zip(table, values, strict=True)) for values in zip(*table.values(), strict=True)]
    listed = planned_ids(folder)
    kept = None if listed is None else set(listed)
    rows = {
        row["trial_id"]: {name: row.get(name) for name in names}
        for row in parse_rows(folder / ROWS_FILE)
        if row is not None and (kept is None or row["trial_id"] in kept)
    }
    return list(rows.values())


def _slot(row: Mapping[str, Any]) -> str:
    """What tells a trial apart, whatever it was made with."""
    values = [row.get(name) or 0 if name in ("level", "repeat") else row.get(name) or "" for name in SLOT]
    return json.dumps(values, default=str)
