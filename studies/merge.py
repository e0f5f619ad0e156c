"""``python -m studies.merge A B [--into C]``: join the results of a study that was made in parts, on two machines.

A and B are results folders, such as results/table2/psb. What joins them goes into A, or into C, which must not hold
results. The tables and curves are made anew.
"""

import argparse
import json
import sys
from pathlib import Path

import hydra.utils
import numpy as np
import pandas as pd
import pyarrow
from omegaconf import OmegaConf
from rich.console import Console

from studies.planning.trial import TIMINGS
from studies.reporting import show
from studies.storage import store

# What two folders may differ in: where and how trials ran, and which of them. Everything else is in all trial_ids, or
# in the tables.
MAY_DIFFER = ("engine", "results_dir", "trial", "gallery", "on_error", "retry_failed", "fresh", "dry_run", "repeats")
MAY_DIFFER_IN_DATASET = ("root", "glob", "models", "categories")


class MergeError(ValueError):
    """Two folders that do not belong together; the message says in what."""


def merge(first, second, into, console):
    """Join the rows of two results folders in a third, or in the first, and make its tables and curves.

    Parameters
    ----------
    first, second, into : Path
    console : rich.console.Console

    Raises
    ------
    MergeError
        where the two are not of one study, or hold different results of one trial
    """
    if into != first and into in store.folders(into):
        raise MergeError(f"{into} holds results already; name a folder that does not, or none")
    for folder in (first, second):
        if not (folder / "config.yaml").exists() or folder not in store.folders(folder):
            below = "".join(f"; {path} is one" for path in store.folders(folder)[:1])
            raise MergeError(f"{folder} is no study's folder, which has config.yaml and trials.parquet{below}")
    configs = [OmegaConf.load(folder / "config.yaml") for folder in (first, second)]
    origins = [json.loads((folder / "provenance.json").read_text()) for folder in (first, second)]
    _check_configs(*configs, first, second)
    _check_versions(*origins, first, second)
    experiment = hydra.utils.instantiate(configs[0].experiment)
    with store.Store(into) as target:
        rows = [store.stored(folder, experiment.columns) for folder in (first, second)]
        kept = _joined(*rows, first, second)
        new = kept[[target.status.get(row.trial_id) != row.status for row in kept.itertuples()]]
        target.add_all(pyarrow.Table.from_pandas(new, preserve_index=False).to_pylist())
        ids = [trial_id for folder in (first, second) for trial_id in store.planned(folder) or ()]
        target.plan(dict.fromkeys([*kept["trial_id"], *ids]))
        cfg = _joined_config(*configs)
        with store.replacing(into / "config.yaml") as path:
            OmegaConf.save(cfg, path)
        meshes = origins[0]["meshes_sha256"] | origins[1]["meshes_sha256"]
        with store.replacing(into / "provenance.json") as path:
            path.write_text(json.dumps(origins[0] | {"meshes_sha256": meshes, "merged_with": origins[1]}, indent=2))
        show.write(experiment, cfg, into, target.frame(kept["trial_id"], experiment.columns), console)
    counts = f"{len(rows[0]):,} rows of {first} and {len(rows[1]):,} of {second}"
    console.print(f"{counts} are {len(kept):,} in {into}", highlight=False, soft_wrap=True)


def _check_configs(a, b, first, second):
    a, b = (_flat(_comparable(cfg)) for cfg in (a, b))
    differ = sorted(key for key in a.keys() | b.keys() if a.get(key) != b.get(key))
    if differ:
        key = differ[0]
        raise MergeError(f"{key} is {a.get(key)!r} in {first} and {b.get(key)!r} in {second}")


def _comparable(cfg):
    """A configuration without what may differ."""
    options = {key: value for key, value in OmegaConf.to_container(cfg).items() if key not in (*MAY_DIFFER, "levels")}
    options["dataset"] = {k: v for k, v in options["dataset"].items() if k not in MAY_DIFFER_IN_DATASET}
    if options.get("parts"):
        options["parts"] = {
            name: {key: value for key, value in part.items() if key != "levels"}
            for name, part in options["parts"].items()
        }
    return options


def _flat(options, prefix=""):
    """Nested dicts as one, keyed by dotted names."""
    if not isinstance(options, dict) or not options:
        return {prefix: options}
    return {
        name: leaf
        for key, value in options.items()
        for name, leaf in _flat(value, f"{prefix}.{key}" if prefix else str(key)).items()
    }


def _check_versions(a, b, first, second):
    a, b = (origin["algorithm_version"] for origin in (a, b))
    if a != b:
        raise MergeError(f"the algorithm_version of {first} is {a}, and of {second} {b}: their results do not compare")


def _joined(a, b, first, second):
    """The rows of both, one a trial, model by model, part by part and level by level as they first occur.

    A row that failed gives way to one that did not.
    """
    results = [column for column in a.columns if column not in TIMINGS]
    good_a, good_b = (rows[rows["status"] == "ok"].set_index("trial_id", drop=False) for rows in (a, b))
    both = good_a.index.intersection(good_b.index)
    same = good_a.loc[both, results].eq(good_b.loc[both, results]) | (
        good_a.loc[both, results].isna() & good_b.loc[both, results].isna()
    )
    same = same.fillna(False).astype(bool)
    if not same.all(axis=None):
        trial_id = both[~same.all(axis=1)][0]
        column = same.columns[~same.loc[trial_id].to_numpy(dtype=bool)][0]
        found = [good.loc[trial_id, column] for good in (good_a, good_b)]
        row = good_a.loc[trial_id]
        raise MergeError(
            f"trial {trial_id} ({row['model']}, {row['part']} {row['level']:g}, repeat {row['repeat']}) has "
            f"{column} {found[0]} in {first} and {found[1]} in {second}"
        )
    joined = pd.concat([a, b], ignore_index=True)
    seen = [joined[key].factorize()[0] for key in ("level", "part", "model")]
    joined = joined.iloc[np.lexsort([joined["repeat"], *seen])]
    failed = joined["status"] != "ok"
    kept = pd.concat([joined[~failed], joined[failed]]).drop_duplicates("trial_id").index
    return joined[joined.index.isin(kept)].reset_index(drop=True)


def _joined_config(a, b):
    """The configuration of both: the first's, with all levels, and as many repeats as either has."""
    joined = OmegaConf.merge(a)
    for one, other in [(joined, b), *((part, b.parts[name]) for name, part in (joined.get("parts") or {}).items())]:
        if one.get("levels"):
            one.levels = list(dict.fromkeys([*one.levels, *other.levels]))
    joined.repeats = max(a.repeats, b.repeats)
    for key in ("models", "categories"):
        if key in joined.dataset:
            chosen = [cfg.dataset[key] for cfg in (a, b)]
            every = None in chosen or "non_rigid" in chosen
            joined.dataset[key] = chosen[0] if every else list(dict.fromkeys([*chosen[0], *chosen[1]]))
    return joined


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="studies.merge", description=__doc__.split("\n\n")[0])
    parser.add_argument("first", type=Path, metavar="A", help="results folder")
    parser.add_argument("second", type=Path, metavar="B", help="results folder")
    parser.add_argument("--into", type=Path, metavar="C", help="folder that holds no results yet (default: A)")
    words = parser.parse_args(arguments)
    try:
        merge(words.first, words.second, words.into or words.first, Console())
    except (ValueError, OSError) as error:
        print(f"studies.merge: error: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
