"""A headless Chromium that is installed, with a WebGL that needs no graphics card."""

import os
import shutil
from contextlib import contextmanager

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
ARGUMENTS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
SECONDS = 120  # for anything that the browser does


@contextmanager
def browser():
    """A browser of playwright; the test is skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is installed, and CHROMIUM names none")
    # A browser that runs as root needs no sandbox of its own here: it opens pages of this project alone.
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(
            executable_path=path, args=[*ARGUMENTS, "--no-sandbox"], timeout=1000 * SECONDS
        )
        try:
            yield started
        finally:
            started.close()
