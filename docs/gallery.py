"""Draws docs/gallery.md: every perturbation that has a study, at the levels of this study, on the cow.

    python docs/gallery.py [NAME ...]

Each picture is the gallery of the study, reduced to a size for a web page. With names, only their pictures are drawn
again; the page always lists all of them.
"""

import inspect
import sys
import tempfile
from pathlib import Path

import yaml
from PIL import Image

import conf
import perturb
import studies

DOCS = Path(__file__).parent
PICTURES = DOCS / "images" / "perturbations"
STUDIES = Path(conf.__file__).parent / "study"

MODEL = "cow"
WIDTHS = (1600, 1400, 1200, 1000, 900, 800)  # pixels; a page's text is 800 wide, and screens may have two for each
LARGEST = 120_000  # bytes of a picture, which is as wide as that allows
COLOURS = 128  # of a picture: hues of some segments, each in several lights

HEADER = f"""\
# Gallery

Every perturbation at the strengths of its study, on the {MODEL} that is bundled. Colours are the segments that the Heat
Walk finds, and the number above each variant is their Change Percentage (CP): what one draw on one model gives, not a
result. Of a study with several parts, the last strength of each is shown. The page and its pictures are drawn by

```sh
python docs/gallery.py
```

[Your perturbation](perturbations.md) has the options of each, and says how to choose other strengths.
"""


def shown() -> list[str]:
    """Names of the perturbations in ``perturb.__all__`` that have a study of the same name, by title."""
    listed = [name for name in perturb.names() if perturb.get(name).__name__ in perturb.__all__]
    return sorted((name for name in listed if study_file(name).exists()), key=lambda name: study(name)["title"])


def study_file(name: str) -> Path:
    """The configuration of a study."""
    return STUDIES / f"{name}.yaml"


def study(name: str) -> dict:
    """The options of a study, without its defaults."""
    return yaml.safe_load(study_file(name).read_text(encoding="utf-8"))


def page() -> str:
    """The text of docs/gallery.md."""
    return "\n".join([HEADER, *map(section, shown())])


def section(name: str) -> str:
    """What a perturbation does, how its study is run, and its picture."""
    title = study(name)["title"]
    summary = inspect.getdoc(perturb.get(name)).partition("\n\n")[0].replace("\n", " ").replace("`", "")
    picture = (PICTURES / f"{name}.png").relative_to(DOCS).as_posix()
    return f"## {title}\n\n{summary} (`+study={name}`)\n\n![{title}: the {MODEL} and its variants]({picture})\n"


def draw(name: str) -> None:
    """Run the study of a perturbation on one model, and keep its gallery as a small picture."""
    with tempfile.TemporaryDirectory() as folder:
        options = [f"dataset.models=[{MODEL}]", f"gallery.models=[{MODEL}]", "repeats=1", f"results_dir={folder}"]
        results = studies.run(name, options, quiet=True)
        with Image.open(results.folder / "gallery.png") as gallery:
            picture = gallery.convert("RGB")
    path = PICTURES / f"{name}.png"
    for width in WIDTHS:
        small = picture.resize((width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS)
        small.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
        if path.stat().st_size <= LARGEST:
            break
    failed = results.rows.loc[results.rows["status"] != "ok", "level"].tolist()
    print(name, *(f"level {level:g} failed" for level in failed), sep=", ", flush=True)


if __name__ == "__main__":
    PICTURES.mkdir(parents=True, exist_ok=True)
    for named in sys.argv[1:] or shown():
        draw(named)
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8", newline="\n")
