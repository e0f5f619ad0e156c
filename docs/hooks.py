"""mkdocs: pictures in the results of the shipped studies are part of the site, without a copy in docs/."""

from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

PICTURES = ("results/shot_noise/bundled/gallery.png",)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add `PICTURES`, under their paths in the repository."""
    root = Path(config.config_file_path).parent
    for path in PICTURES:
        files.append(File.generated(config, path, abs_src_path=str(root / path)))
    return files
