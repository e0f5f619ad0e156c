"""mkdocs: what pages have that is not written in them: pictures of shipped results, and the list of methods."""

import sys
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

PICTURES = ("results/shot_noise/bundled/gallery.png",)
METHODS = "<!-- the table of methods -->"  # in a page, where docs/methods.py puts the table


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add `PICTURES`, under their paths in the repository."""
    root = Path(config.config_file_path).parent
    for path in PICTURES:
        files.append(File.generated(config, path, abs_src_path=str(root / path)))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Put the table of methods where a page has `METHODS`."""
    if METHODS not in markdown:
        return markdown
    root = Path(config.config_file_path).parent
    sys.path[:0] = [str(root), str(root / "docs")]
    from methods import table_of_methods

    return markdown.replace(METHODS, table_of_methods())
