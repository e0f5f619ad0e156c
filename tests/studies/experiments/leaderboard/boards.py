"""Rows of leaderboards that are typed by hand or drawn, without running anything."""

import json

import numpy as np
import pandas as pd

TARGETS = {
    "HeatWalk": "studies.segmenters.HeatWalk",
    "OneSegment": "studies.segmenters.one_segment.OneSegment",
    "Voronoi": "studies.segmenters.voronoi.Voronoi",
}


def rows_of(values, *, told=(), truth=None, original=0.1):
    """Rows from {method: {part: [[value of each model] of each strength]}}; None is a trial that failed.

    ``truth`` is a function: Change Percentage -> Rand Index error; without it there is no ground truth.
    """
    records = []
    for method, parts in values.items():
        options = {"told_n_segments": 4} if method in told else {}
        for part, strengths in {"original": [[0.0] * len(next(iter(parts.values()))[0])], **parts}.items():
            for level, of_models in enumerate(strengths):
                for i, value in enumerate(of_models):
                    records.append(
                        {
                            "segmenter": method,
                            "segmenter_options": json.dumps(options),
                            "target": TARGETS.get(method, ""),
                            "part": part,
                            "level": float(level),
                            "model": f"m{i}",
                            "repeat": 0,
                            "status": "failed" if value is None else "ok",
                            "change_percentage": np.nan if value is None else value,
                            "truth_rand_index_error": np.nan
                            if value is None or truth is None
                            else original
                            if part == "original"
                            else truth(value),
                            "seconds_segment": 0.5,
                        }
                    )
    return pd.DataFrame(records)


def drawn(methods, parts, n_models, seed=0, n_strengths=5):
    """Rows of random values: methods that differ by factors, a few failures, and a part that the last method lacks."""
    rng = np.random.default_rng(seed)
    factors = rng.lognormal(0, 0.7, len(methods))
    values = {
        method: {
            part: [
                [
                    None if rng.random() < 0.01 else float(min(199, factor * 5 * strength * rng.lognormal(0, 0.4)))
                    for _ in range(n_models)
                ]
                for strength in range(1, n_strengths + 1)
            ]
            for part in (parts if method != methods[-1] or len(parts) < 3 else parts[:-1])
        }
        for method, factor in zip(methods, factors, strict=True)
    }
    return rows_of(values, told=methods[1::2], truth=lambda value: min(1.0, 0.1 + value / 300))
