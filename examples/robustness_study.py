"""Run a small study from Python, and read its rows and tables.

python examples/robustness_study.py [RESULTS_DIR]
"""

import sys

import studies


def main(results_dir: str = "mine") -> None:
    results = studies.run(
        "shot_noise",
        ["dataset.models=[cow]", "levels=[0.05,0.2]", "repeats=2", "gallery.models=0", f"results_dir={results_dir}"],
    )

    table = results.tables["table"]  # one row per level
    print(table[["level", "mean", "ci_low", "ci_high", "n"]].to_string(index=False))

    rows = results.rows  # one row per trial
    worst = rows.loc[rows["change_percentage"].idxmax()]
    print(f"worst: {worst['model']} at level {worst['level']:g}, repeat {worst['repeat']}: seed {worst['seed']}")
    print(f"all files: {results.folder}")


if __name__ == "__main__":
    main(*sys.argv[1:])
