"""Join the results of a study that was made in parts, for example on two machines."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from studies.columns import Column
from studies.planning.trial import TIMINGS
from studies.storage.atomic import atomic_write
from studies.storage.folders import planned_ids, result_folders
from studies.storage.identity import declared_options, differences, identity
from studies.storage.records import CONFIG_FILE, PROVENANCE_FILE, read_config, read_provenance
from studies.storage.rows import RowStore, read_rows

if TYPE_CHECKING:
    import pandas as pd

Options = dict[str, Any]


class MergeError(ValueError):
    """Two results folders cannot be merged; the message tells why."""


@dataclass(frozen=True)
class Merged:
    """Two results folders in one.

    Parameters
    ----------
    options : dict
        the configuration, as in config.yaml
    rows : pandas.DataFrame
        the rows of both, one per trial
    n_first, n_second : int
        how many rows each of the folders has
    """

    options: Options
    rows: "pd.DataFrame"
    n_first: int
    n_second: int


def check_folders(first: Path, second: Path, into: Path) -> None:
    """Check that two folders contain results, and that a third one does not.

    Parameters
    ----------
    first, second : Path
        results folders
    into : Path
        may be ``first``

    Raises
    ------
    MergeError
        If they are not.
    """
    if into != first and into in result_folders(into):
        raise MergeError(f"{into} contains results already; choose another folder, or none")
    for folder in (first, second):
        found = result_folders(folder)
        if folder not in found or not (folder / CONFIG_FILE).exists():
            hint = f"; {found[0]} is one" if found else ""
            raise MergeError(
                f"{folder} is not the results folder of a study, with config.yaml and trials.parquet{hint}"
            )


def read_options(folder: Path) -> Options:
    """The configuration of a results folder, as plain dicts and lists; StudyError if it is damaged."""
    return read_config(folder)


def merge(
    first: Path, second: Path, into: Path, columns: Sequence[Column], write_tables: Callable[[Merged], None]
) -> Merged:
    """Join the rows, plans, configurations and provenances of two results folders.

    Parameters
    ----------
    first, second : Path
        results folders of one study
    into : Path
        where to write; may be ``first``
    columns : sequence of Column
        the columns of the rows
    write_tables : callable
        called when all else is written and ``into`` is still locked

    Raises
    ------
    MergeError
        If the two are not of one study, or contain different results of one trial.
    StoreLockedError
        If another process writes to ``into``.
    """
    check_folders(first, second, into)
    a, b = read_options(first), read_options(second)
    _check_options(a, b, first, second)
    origin_a, origin_b = _read_provenance(first), _read_provenance(second)
    _check_versions(origin_a, origin_b, first, second)
    with RowStore(into) as store:
        rows_a, rows_b = read_rows(first, columns), read_rows(second, columns)
        rows = _merge_rows(rows_a, rows_b, first, second)
        new = rows[[store.status.get(i) != status for i, status in zip(rows["trial_id"], rows["status"], strict=True)]]
        store.add_all(_as_dicts(new))
        planned = [trial_id for folder in (first, second) for trial_id in planned_ids(folder) or ()]
        store.write_plan(dict.fromkeys([*rows["trial_id"], *planned]))
        options = merge_options(a, b)
        with atomic_write(into / CONFIG_FILE) as path:
            path.write_text(yaml.safe_dump(options, sort_keys=False, allow_unicode=True), "utf-8")
        meshes = origin_a["meshes_sha256"] | origin_b["meshes_sha256"]
        with atomic_write(into / PROVENANCE_FILE) as path:
            origin = origin_a | {"meshes_sha256": meshes, "merged_with": origin_b}
            path.write_text(json.dumps(origin, indent=2) + "\n", "utf-8")
        merged = Merged(options, store.frame(rows["trial_id"], columns), len(rows_a), len(rows_b))
        write_tables(merged)
    return merged


def _read_provenance(folder: Path) -> dict[str, Any]:
    """The origin of results, with what `merge` needs."""
    origin = read_provenance(folder)
    for key, kind in (("algorithm_version", int), ("meshes_sha256", dict)):
        if not isinstance(origin.get(key), kind):
            raise MergeError(f"{folder / PROVENANCE_FILE} is not the origin of results: it lacks {key}")
    return origin


def _check_options(a: Options, b: Options, first: Path, second: Path) -> None:
    flat_a, flat_b = identity(a), identity(b)
    for key in sorted(differences(flat_a, flat_b) | differences(flat_b, flat_a)):
        raise MergeError(f"{key} is {flat_a.get(key)!r} in {first} and {flat_b.get(key)!r} in {second}")


def _check_versions(a: Mapping[str, Any], b: Mapping[str, Any], first: Path, second: Path) -> None:
    version_a, version_b = a["algorithm_version"], b["algorithm_version"]
    if version_a != version_b:
        raise MergeError(
            f"the algorithm_version is {version_a} in {first} and {version_b} in {second}: their results cannot be "
            "compared"
        )


def _merge_rows(a: "pd.DataFrame", b: "pd.DataFrame", first: Path, second: Path) -> "pd.DataFrame":
    """The rows of both, one per trial, ordered by model, segmenter, part and level as these first occur.

    A successful row replaces one that failed.
    """
    import pandas as pd

    _check_results(a, b, first, second)
    rows = in_order(pd.concat([a, b], ignore_index=True))
    failed = rows["status"] != "ok"
    kept = pd.concat([rows[~failed], rows[failed]]).drop_duplicates("trial_id").index
    return rows[rows.index.isin(kept)].reset_index(drop=True)


def in_order(rows: "pd.DataFrame") -> "pd.DataFrame":
    """Rows by model, segmenter, part and level as these first occur, and by repeat."""
    keys = [rows[key].factorize()[0] for key in ("level", "part", "segmenter", "model")]
    return rows.iloc[np.lexsort([rows["repeat"].to_numpy(), *keys])]


def _check_results(a: "pd.DataFrame", b: "pd.DataFrame", first: Path, second: Path) -> None:
    """Raise MergeError if a trial that succeeded in both has different results."""
    columns = [column for column in a.columns if column not in TIMINGS]
    good_a, good_b = (rows[rows["status"] == "ok"].set_index("trial_id", drop=False) for rows in (a, b))
    both = good_a.index.intersection(good_b.index)
    a, b = good_a.loc[both, columns], good_b.loc[both, columns]
    same = (a.eq(b) | (a.isna() & b.isna())).fillna(False).astype(bool)
    if same.all(axis=None):
        return
    trial_id = both[~same.all(axis=1)][0]
    column = same.columns[~same.loc[trial_id].to_numpy(dtype=bool)][0]
    row = a.loc[trial_id]
    raise MergeError(
        f"trial {trial_id} ({row['model']}, {row['part']} {row['level']:g}, repeat {row['repeat']}) has "
        f"{column} {row[column]} in {first} and {b.loc[trial_id, column]} in {second}"
    )


def _as_dicts(rows: "pd.DataFrame") -> list[dict[str, Any]]:
    """Rows with None for missing values, as JSON knows them."""
    import pyarrow

    return pyarrow.Table.from_pandas(rows, preserve_index=False).to_pylist()


def merge_options(a: Options, b: Options) -> Options:
    """The options of ``a`` with the levels, repeats and models of both, and what the experiment declares to select."""
    merged = dict(a)
    for key in declared_options(a, "presenting"):
        if key in b:
            merged[key] = b[key]
    for key in declared_options(a, "selecting"):
        if key in a and key in b and key != "segmenter":
            merged[key] = _both(a[key], b[key])
    merged["levels"] = _union(a.get("levels"), b.get("levels"))
    if not merged["levels"]:
        del merged["levels"]
    if a.get("parts"):
        merged["parts"] = {
            name: part | ({"levels": _union(part["levels"], b["parts"][name]["levels"])} if part.get("levels") else {})
            for name, part in a["parts"].items()
        }
    merged["repeats"] = max(a.get("repeats", 1), b.get("repeats", 1))
    merged["dataset"] = dict(a["dataset"])
    for key in ("models", "categories"):
        if key in merged["dataset"]:
            chosen = [options["dataset"][key] for options in (a, b)]
            is_open = None in chosen or "non_rigid" in chosen
            merged["dataset"][key] = chosen[0] if is_open else _union(*chosen)
    return merged


def _both(a: Any, b: Any) -> Any:
    """What selects all that either of two options does: null selects everything."""
    if a is None or b is None:
        return None
    if isinstance(a, int) and isinstance(b, int):
        return max(a, b)
    a, b = ([each] if isinstance(each, str) else each for each in (a, b))
    return [*a, *(each for each in b if each not in a)]


def _union(a: Sequence[Any] | None, b: Sequence[Any] | None) -> list[Any]:
    """The values of both, each once; sorted if those of ``a`` are."""
    union = list(dict.fromkeys([*(a or ()), *(b or ())]))
    is_numeric = all(isinstance(value, int | float) for value in union)
    for descending in (False, True):
        if is_numeric and list(a or ()) == sorted(a or (), reverse=descending):
            return sorted(union, reverse=descending)
    return union
