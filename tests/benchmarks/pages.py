"""How long a page takes until its first scene is drawn, in headless Chromium with software rendering.

Run as ``python -m tests.benchmarks.pages [PAGE.html …]`` from the root of the repository. Without pages, that of a
study is made first, in a folder that is removed afterwards: 3 models, 6 levels, 2 methods. Seconds count from the start
of the navigation to the frame after the first scene has been drawn; CPU seconds are those of all the browser's
processes meanwhile. Other work on the machine delays the former and hardly the latter.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from tests.helpers.browser import SECONDS, browser

STUDY = [
    "segmenters=[heat_walk,heat_walk_robust]",
    "levels=[0.05,0.1,0.2,0.3,0.4,0.5]",
    "repeats=1",
    "page.models=3",
    "page.columns=6",
    "page.worst=0",
    "engine.workers=1",
]
TIMES = 5
WINDOW = {"width": 1280, "height": 900}

# Notes the time at which the first scene has been drawn: pixels can be read when everything has been rasterised.
NOTE = """addEventListener("DOMContentLoaded", () => viewer.ready.then(() => {
  const gl = document.getElementById("canvas").getContext("webgl2");
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  requestAnimationFrame(() => setTimeout(() => { window.drawn = performance.now(); }));
}));"""


def cpu_seconds(session: Any) -> float:
    """CPU seconds of all processes of the browser so far."""
    return sum(float(each["cpuTime"]) for each in session.send("SystemInfo.getProcessInfo")["processInfo"])


def measure(started: Any, path: Path) -> tuple[float, float]:
    """Seconds until the first scene of a page is drawn, and CPU seconds."""
    session = started.new_browser_cdp_session()
    context = started.new_context(viewport=WINDOW)
    page = context.new_page()
    page.add_init_script(NOTE)
    before = cpu_seconds(session)
    page.goto(path.resolve().as_uri(), timeout=1000 * SECONDS)
    page.wait_for_function("window.drawn", timeout=1000 * SECONDS)
    after = cpu_seconds(session)
    seconds = page.evaluate("window.drawn") / 1000
    context.close()
    return seconds, after - before


def page_of_a_study(folder: Path) -> Path:
    """A page of 3 models, 6 levels and 2 methods."""
    import studies

    return studies.run("shot_noise", [*STUDY, f"results_dir={folder}"]).folder / "report.html"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("pages", nargs="*", type=Path, metavar="PAGE.html")
    parser.add_argument("--times", type=int, default=TIMES, help="how often each is opened (default: %(default)s)")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder, browser() as started:
        for path in options.pages or [page_of_a_study(Path(folder))]:
            drawn, cpu = zip(*(measure(started, path) for _ in range(options.times)), strict=True)
            print(
                f"{path}: {path.stat().st_size / 1e6:.2f} MB, drawn after {median(drawn):.2f} s "
                f"({min(drawn):.2f} to {max(drawn):.2f}), {median(cpu):.2f} CPU s ({min(cpu):.2f} to {max(cpu):.2f})"
            )


if __name__ == "__main__":
    main()
