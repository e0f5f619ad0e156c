"""The scores of methods: pure functions of the rows of trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from perturb import PerturbationError
from studies.experiments.leaderboard.cards import Card, cards_of
from studies.experiments.pairing import difference
from studies.statistics.bootstrap import NO_INTERVAL, quantile_interval
from studies.statistics.paired import intervals, resampled_counts, resampled_mce, resampled_means
from studies.statistics.ranks import pareto_front, shared_ranks
from studies.statistics.severity import areas, cell_values, common_cells, corruption_errors, part_means

if TYPE_CHECKING:
    import pandas as pd

CP, MOST_CP = "change_percentage", 200.0  # and the bound that a failed trial counts with
RAND, MOST_RAND = "truth_rand_index_error", 1.0
MEMORY = "peak_memory"
NO_VARIANT = f"{PerturbationError.__name__}:"  # beginning of the error of a trial whose variant could not be made


@dataclass(frozen=True)
class Options:
    """What scores depend on besides the rows.

    Parameters
    ----------
    original : str
        the part with the unperturbed meshes
    controls : tuple of str
        parts that do not count for the mean corruption error
    relative_to : str
        the method whose corruption errors are 1
    paired_with : str, optional
        the method from whose mean corruption error the differences are computed
    order : tuple of str
        parts in the order in which they are shown; others follow
    """

    original: str = "original"
    controls: tuple[str, ...] = ()
    relative_to: str = "HeatWalk"
    paired_with: str | None = None
    order: tuple[str, ...] = ()


class Scores:
    """The scores of all methods of a leaderboard.

    Parameters
    ----------
    rows : DataFrame
        trials; a trial that failed, timed out or crashed counts with the worst value of each measure, unless its
        perturbation could not make the variant, which is not the method's failure
    options : Options

    Attributes
    ----------
    methods : list of str
        in the order of their first rows
    cards : dict
        method -> what it is

    Examples
    --------
    >>> import pandas as pd
    >>> rows = pd.DataFrame({"segmenter": ["HeatWalk", "cuts"], "part": "holes", "level": 1.0, "model": "cow",
    ...                      "status": "ok", "change_percentage": [2.0, 3.0]})
    >>> Scores(rows, Options()).board.set_index("segmenter")["mce"].to_dict()
    {'HeatWalk': 1.0, 'cuts': 1.5}
    """

    def __init__(self, rows: pd.DataFrame, options: Options) -> None:
        for name in (RAND, "seconds_segment"):
            if name not in rows:
                rows = rows.assign(**{name: np.nan})
        self.options = options
        self.methods = [str(name) for name in dict.fromkeys(rows["segmenter"])]
        self.cards: dict[str, Card] = cards_of(rows)
        without = _without_variant(rows)
        self._unmade, self._rows = rows[without], rows[~without]
        self._counted = _of_common_cells(self._rows)

    @property
    def n_left_out(self) -> int:
        """How many trials are not compared, because fewer than half of the methods have them."""
        return len(self._rows) - len(self._counted)

    @property
    def compared(self) -> pd.DataFrame:
        """The trials that are compared."""
        return self._counted

    @cached_property
    def unmade_variants(self) -> list[tuple[str, float, str]]:
        """Part, strength and model of the variants that their perturbation could not make."""
        drawn = self._unmade[["part", "level", "model"]].drop_duplicates()
        return [(str(part), float(level), str(model)) for part, level, model in drawn.itertuples(index=False)]

    @cached_property
    def models(self) -> list[str]:
        """The models that are compared."""
        return [str(name) for name in dict.fromkeys(self._counted["model"])]

    @cached_property
    def parts(self) -> list[str]:
        """The perturbations that count, then the controls."""
        present = set(self._counted["part"]) - {self.options.original}
        ordered = [name for name in dict.fromkeys((*self.options.order, *self._counted["part"])) if name in present]
        return sorted(ordered, key=lambda name: name in self.options.controls)

    @property
    def counting(self) -> list[str]:
        """The perturbations without the controls."""
        return [name for name in self.parts if name not in self.options.controls]

    @property
    def controls(self) -> list[str]:
        """The controls."""
        return [name for name in self.parts if name in self.options.controls]

    @cached_property
    def change(self) -> pd.DataFrame:
        """Change Percentage of every method in every cell of the perturbed parts."""
        return self._cells(CP, MOST_CP, self.parts)

    @cached_property
    def mean_change(self) -> pd.DataFrame:
        """Mean Change Percentage by method and part."""
        return self._by_part(part_means(self.change))

    @cached_property
    def corruption_errors(self) -> pd.DataFrame:
        """Corruption error by method and part."""
        return self._by_part(corruption_errors(self.change, self.options.relative_to))

    @cached_property
    def undefined(self) -> list[str]:
        """The counting parts under which the reference does not change at all."""
        if self.options.relative_to not in self.methods:
            return []
        return [name for name in self.counting if self.mean_change.loc[self.options.relative_to, name] == 0]

    @cached_property
    def failures(self) -> pd.DataFrame:
        """Number of failed trials by method and part."""
        return self._count(self._counted["status"] != "ok")

    @cached_property
    def trials(self) -> pd.DataFrame:
        """Number of trials that were run by method and part."""
        return self._count(self._counted["status"].notna())

    @cached_property
    def missing(self) -> pd.DataFrame:
        """Number of cells that were not run by method and part, among those that at least half of the methods have."""
        absent = self.change.isna()
        of_part = absent.columns.get_level_values(0)
        frame = absent.T.groupby(of_part, sort=False).sum().T
        return self._by_part(frame)

    @cached_property
    def is_complete(self) -> dict[str, bool]:
        """Whether a method has every cell that counts."""
        return {name: not self.missing.loc[name, self.counting].any() for name in self.methods}

    @cached_property
    def complete(self) -> list[str]:
        """The methods that have every cell that counts."""
        return [name for name in self.methods if self.is_complete[name]]

    @cached_property
    def ranked(self) -> list[str]:
        """The complete methods that are not baselines."""
        return [name for name in self.complete if not self.cards[name].baseline]

    @property
    def has_intervals(self) -> bool:
        """Whether there are several models, which can be resampled."""
        return len(self.models) > 1

    @cached_property
    def board(self) -> pd.DataFrame:
        """A row per method: those with a rank in its order, then baselines and those with missing cells."""
        import pandas as pd

        mce = self.corruption_errors[self.counting].mean(axis=1)
        mce_samples, mce_bounds = self._mce_resampled()
        clean, rand = self._rand_of([self.options.original]), self._rand_of(self.counting)
        ranks = self._ranks(mce, mce_samples)
        accuracy_ranks = self._accuracy_ranks(rand)
        front = pareto_front(
            [clean.get(name, np.nan) for name in self.methods],
            [mce[name] if self.is_complete[name] else np.nan for name in self.methods],
        )
        within = self._ranks_within_kinds(mce, mce_samples)
        records = [
            {
                "rank": ranks.get(name),
                "method": self.cards[name].label,
                "segmenter": name,
                "k": "told" if self.cards[name].told else "finds",
                "baseline": "yes" if self.cards[name].baseline else "",
                "mce": mce[name],
                "mce_low": mce_bounds.get(name, (np.nan, np.nan))[0],
                "mce_high": mce_bounds.get(name, (np.nan, np.nan))[1],
                **self._difference(name, mce, mce_samples),
                "rank_of_kind": within.get(name),
                "mean_cp": self.mean_change.loc[name, self.counting].mean(),
                "control_cp": self.mean_change.loc[name, self.controls].mean() if self.controls else np.nan,
                "rand_original": clean.get(name, np.nan),
                "rand_perturbed": rand.get(name, np.nan),
                "rand_loss": rand.get(name, np.nan) - clean.get(name, np.nan),
                "rank_of_accuracy": accuracy_ranks.get(name),
                "pareto": "yes" if on_front else "",
                "failed_share": 100 * self._of(name, self._counted)["status"].ne("ok").mean(),
                "missing": int(self.missing.loc[name].to_numpy().sum()),
                "seconds": self._median_seconds(name),
                "n": int((self._counted["segmenter"] == name).sum()),
            }
            | self._memory(name)
            for name, on_front in zip(self.methods, front, strict=True)
        ]
        frame = pd.DataFrame(records)
        for column in ("rank", "rank_of_kind", "rank_of_accuracy"):
            frame[column] = frame[column].astype("Int64")
        frame["_incomplete"] = [not self.is_complete[name] for name in self.methods]
        frame["_unranked"] = [name not in self.ranked for name in self.methods]
        order = ["_incomplete", "_unranked", "rank", "mce", "method"]
        return frame.sort_values(order, kind="stable").drop(columns=order[:2]).reset_index(drop=True)

    @cached_property
    def accuracy_intervals(self) -> dict[str, tuple[float, float]]:
        """The 95 % interval of the Rand Index error on the variants, by method."""
        values = self._rand_by_model(self.counting)
        if len(values.columns) < 2:
            return {}
        samples = resampled_means(values.to_numpy(), resampled_counts(len(values.columns)))
        return dict(zip(values.index, intervals(samples), strict=True))

    def _mce_resampled(self) -> tuple[dict[str, NDArray[np.float64]], dict[str, tuple[float, float]]]:
        """Resampled mean corruption errors of the complete methods, and their intervals."""
        reference = self.options.relative_to
        if not self.has_intervals or reference not in self.complete or not self.counting:
            return {}, {}
        counting = self.change.loc[self.complete, self.change.columns.get_level_values(0).isin(self.counting)]
        sums = areas(counting)
        samples = resampled_mce(sums, sums[self.complete.index(reference)], resampled_counts(sums.shape[2]))
        by_method = dict(zip(self.complete, samples.T, strict=True))
        return by_method, dict(zip(self.complete, intervals(samples), strict=True))

    def _difference(self, name: str, mce: pd.Series, samples: Mapping[str, NDArray[np.float64]]) -> dict[str, float]:
        """The difference of a method's mean corruption error from that of ``paired_with``, with its interval."""
        other = self.options.paired_with
        if other is None:
            return {}
        paired = name != other and name in samples and other in samples
        low, high = quantile_interval(samples[name] - samples[other]) if paired else NO_INTERVAL
        known = name != other and other in self.methods
        return difference(mce[name] - mce[other] if known else np.nan, (low, high))

    def _ranks(
        self, mce: pd.Series, samples: dict[str, NDArray[np.float64]], methods: Sequence[str] | None = None
    ) -> dict[str, int | None]:
        """Ranks by mean corruption error among some methods, by default all that are ranked."""
        names = self.ranked if methods is None else methods
        if not names:
            return {}
        resampled = np.stack([samples[name] for name in names], axis=1) if samples else None
        return dict(zip(names, shared_ranks([mce[name] for name in names], resampled), strict=True))

    def _ranks_within_kinds(self, mce: pd.Series, samples: dict[str, NDArray[np.float64]]) -> dict[str, int | None]:
        """Ranks among the methods that are told k, and among those that are not."""
        found: dict[str, int | None] = {}
        for told in (True, False):
            kind = [name for name in self.ranked if self.cards[name].told == told]
            found |= self._ranks(mce, samples, kind)
        return found

    def _accuracy_ranks(self, rand: dict[str, float]) -> dict[str, int | None]:
        """Ranks by the Rand Index error on the variants."""
        values = self._rand_by_model(self.counting)
        names = [name for name in self.ranked if name in values.index and not values.loc[name].isna().any()]
        if not names:
            return {}
        several = len(values.columns) > 1
        samples = (
            resampled_means(values.loc[names].to_numpy(), resampled_counts(len(values.columns))) if several else None
        )
        return dict(zip(names, shared_ranks([rand[name] for name in names], samples), strict=True))

    def _rand_of(self, parts: Sequence[str]) -> dict[str, float]:
        """Mean Rand Index error over parts of models with ground truth, by method."""
        return {str(name): value for name, value in self._rand_by_model(parts).mean(axis=1).items()}

    def _rand_by_model(self, parts: Sequence[str]) -> pd.DataFrame:
        """Mean Rand Index error over cells of some parts: a row per method, a column per model with ground truth."""
        with_truth = set(self._counted.loc[self._counted[RAND].notna(), "model"])
        rows = self._counted[self._counted["part"].isin(parts) & self._counted["model"].isin(with_truth)]
        cells = cell_values(rows, RAND, MOST_RAND)
        # A variant of which nothing is left has no accuracy, whatever the method.
        cells = cells.loc[:, cells.notna().any()]
        return cells.T.groupby(cells.columns.get_level_values(2), sort=False).mean().T

    def _cells(self, column: str, bound: float, parts: Sequence[str]) -> pd.DataFrame:
        cells = cell_values(self._counted[self._counted["part"].isin(parts)], column, bound)
        return cells.reindex(index=self.methods)

    def _by_part(self, frame: pd.DataFrame) -> pd.DataFrame:
        return frame.reindex(index=self.methods, columns=self.parts)

    def _count(self, condition: pd.Series) -> pd.DataFrame:
        counts = condition.groupby([self._counted["segmenter"].astype(object), self._counted["part"].astype(object)])
        return self._by_part(counts.sum().unstack()).fillna(0).astype(int)

    def _of(self, method: str, rows: pd.DataFrame) -> pd.DataFrame:
        return rows[rows["segmenter"] == method]

    def _median_seconds(self, method: str) -> float:
        """Median over successful trials of the seconds that segmenting took."""
        rows = self._of(method, self._counted)
        return float(rows.loc[rows["status"] == "ok", "seconds_segment"].astype("float64").median())

    def _memory(self, method: str) -> dict[str, float]:
        """The largest peak of memory; nothing where rows do not have it."""
        if MEMORY not in self._counted or self._counted[MEMORY].isna().all():
            return {}
        return {MEMORY: float(self._of(method, self._counted)[MEMORY].astype("float64").max())}


def _without_variant(rows: pd.DataFrame) -> pd.Series:
    """Whether the perturbation of a trial could not make the variant."""
    import pandas as pd

    if "error" not in rows:
        return pd.Series(False, index=rows.index)
    return rows["status"].ne("ok") & rows["error"].astype(object).fillna("").astype(str).str.startswith(NO_VARIANT)


def _of_common_cells(rows: pd.DataFrame) -> pd.DataFrame:
    """The trials of cells that at least half of the methods have."""
    present = rows.assign(present=1.0, status="ok")
    cells = set(common_cells(cell_values(present, "present", 1.0)).columns)
    kept = [cell in cells for cell in zip(rows["part"], rows["level"], rows["model"], strict=True)]
    return rows[np.array(kept, dtype=bool)]
