"""Compare a segmenter of your own with the Heat Walk, under exactly the same perturbed meshes.

python examples/compare_segmenters.py [RESULTS_DIR]
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import studies


def slabs(vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int = 4) -> NDArray[np.int64]:
    """Label vertices by slabs of equal thickness across the longest axis of the bounding box."""
    position = vertices[:, np.ptp(vertices, axis=0).argmax()]
    share = (position - position.min()) / np.ptp(position)
    return np.minimum((count * share).astype(np.int64), count - 1)


def main(results_dir: str = "mine") -> None:
    own = f"{Path(__file__).stem}.slabs"  # workers import the function by this name
    results = studies.run(
        "shot_noise",
        [
            f"segmenters=[heat_walk,{own}]",
            "dataset.models=[cow]",
            "levels=[0.05,0.2]",
            "repeats=2",
            "gallery.models=0",
            f"results_dir={results_dir}",
        ],
    )
    table = results.tables["table"]
    print(table.pivot(index="level", columns="segmenter", values="mean").round(2).to_string())


if __name__ == "__main__":
    main(*sys.argv[1:])
