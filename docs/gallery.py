"""Draws docs/gallery.md: every perturbation that has a study, at the levels of this study, on the cow.

    python docs/gallery.py [NAME ...]

Each picture is the gallery of the study, reduced to a size for a web page. With names, only their pictures are drawn
again; the page always lists all of them.
"""

import inspect
import re
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
# What the perturbations mean

What each perturbation does, what happens in practice that it stands for, and its picture at the levels of its study, on
the {MODEL} that is bundled. Colours are the segments that the Heat Walk finds, and the number above each variant is
their Change Percentage (CP): what one draw on one model gives, not a result. Of a study with several parts, the last
level of each is shown. The page and its pictures are drawn by

```sh
python docs/gallery.py
```

[Your perturbation](perturbations.md) has the options of each, and says how to choose other levels.
"""

# What happens in practice that a perturbation stands for.
PRACTICE = {
    "affine": "Different proportions: bodies of other builds, models scaled along one axis, calibration errors.",
    "bending": "Other poses and soft deformation: bending without a skeleton, as of cloth, rubber or tissue.",
    "composite": "A scan as it comes from the pipeline: several faults at once, none of them strong.",
    "decimation": "Simplification, as for games, previews and transmission: far fewer triangles, and worse ones.",
    "duplicates": "Export errors and merged scenes, in which the same part is written twice.",
    "flipped": "Inconsistent winding, as of models made by hand and of files joined from several sources.",
    "floaters": "Dust, reflections and outliers of scanners, which become specks beside the surface.",
    "holes": "Missing measurements: dark, shiny or hidden places, and triangles lost in conversion.",
    "local_scale": "Variation within a class: a larger head, a shorter leg, and swelling or shrinking parts.",
    "micro_holes": "Drop-outs of a scanner, and the pinholes that stitching and repair tools leave.",
    "missing_parts": "Partial data: a limb outside the scanner's view, a broken find, or a model that was cropped.",
    "normal_noise": "The measuring noise of scanners and of reconstruction from images, everywhere on the surface.",
    "quantisation": "Compressed and single-precision files (glTF, Draco, STL), and models far from the origin.",
    "rasterisation": "Surfaces from voxels: medical images, neural fields, and repair that makes meshes watertight.",
    "renumbering": "A control: other programs write the same mesh in another order.",
    "rotation": "A control: other programs have another axis that points up.",
    "sampling": "Uneven density: scanners sample near and facing surfaces densely, and modellers the details.",
    "scaling": "Other units: the same model in millimetres, metres or inches.",
    "self_intersections": "Skinned animation and editing, after which parts pass through each other.",
    "short_circuits": "Wrong topology from reconstruction: fingers or legs that touch are joined by handles.",
    "shot_noise": "Outliers: a few measurements that are far off, as at edges and on shiny surfaces.",
    "slivers": "Triangles of bad quality on a good surface, as from Boolean operations and CAD exporters.",
    "smoothing": "Denoising and low-resolution capture, which round off details and shrink what is thin.",
    "tessellation": "Remeshing: the same surface with the triangles of another program.",
    "translation": "A control: geographic and CAD coordinates far from the origin, where numbers are coarser.",
    "unwelded": "Formats without shared vertices, such as STL: faces that touch without being connected.",
    "view": "Scans from a few sides only: what no camera saw is missing.",
    "welding": "Parts that touch glued together, by merging near vertices or by reconstruction at low resolution.",
}


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
    """What a perturbation does and stands for, its levels, how its study is run, and its picture."""
    title = study(name)["title"]
    summary = inspect.getdoc(perturb.get(name)).partition("\n\n")[0].replace("\n", " ").replace("`", "")
    picture = (PICTURES / f"{name}.png").relative_to(DOCS).as_posix()
    return (
        f"## {title}\n\n{summary} (`+study={name}`)\n\n- In practice: {PRACTICE[name]}\n- Levels: {levels(name)}\n\n"
        f"![{title}: the {MODEL} and its variants]({picture})\n"
    )


def levels(name: str) -> str:
    """The levels of a study, what they are, and their unit, as its file says."""
    text, options = study_file(name).read_text(encoding="utf-8"), study(name)
    meaning = re.search(r"^levels: .*?#\s*(.+)$|#\s*levels: (.+)$", text, re.MULTILINE)
    parts = options.get("parts", {"": options})
    values = dict.fromkeys(level for part in parts.values() for level in part["levels"])
    unit = yaml.safe_load((STUDIES.parent / "perturbation" / f"{name}.yaml").read_text(encoding="utf-8"))["unit"]
    return f"{', '.join(f'{value:g}' for value in values)} ({meaning[1] or meaning[2]}); `unit={unit}`"


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
