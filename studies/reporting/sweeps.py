"""What a sweep found: the tables of its studies as one table, and a curve over the option that it varied."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import yaml

from studies.columns import Column, Table
from studies.planning.names import folder_name
from studies.planning.titles import full_title
from studies.reporting.latex import latex
from studies.reporting.results import Results
from studies.reporting.text import markdown_page, print_table
from studies.storage import atomic_write, encodable

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console


@dataclass(frozen=True)
class Sweep:
    """The studies of a sweep that vary the same options, in the folder of their study and dataset.

    Parameters
    ----------
    studies : sequence of Results
        at least two, ordered by the values of the options
    options : tuple of str
        the options that are varied
    """

    studies: Sequence[Results]
    options: tuple[str, ...]

    PREFIX: ClassVar[str] = "sweep_by_"

    @property
    def folder(self) -> Path:
        """The folder that contains those of the studies."""
        return self.studies[0].folder.parent

    @property
    def folders(self) -> set[Path]:
        """The folders of the studies."""
        return {study.folder for study in self.studies}

    @property
    def stem(self) -> str:
        """The name of the files of the sweep, without their suffix."""
        return folder_name(self.PREFIX + ",".join(self.options))

    def file(self, suffix: str) -> Path:
        """A file of the sweep, which is in the folder above those of its studies."""
        return self.folder / f"{self.stem}{suffix}"

    @property
    def title(self) -> str:
        """The title of the studies, without what differs."""
        first = self.studies[0]
        methods = list(dict.fromkeys(method for study in self.studies for method in study.methods))
        if any(option.startswith("segmenter.") for option in self.options):
            methods = list(dict.fromkeys(method.partition(" (")[0] for method in methods))
        subsets = {study.subset for study in self.studies}
        return full_title(first.base_title, first.dataset, methods, subsets.pop() if len(subsets) == 1 else "")

    @property
    def table(self) -> Table:
        """The main tables of the studies below each other, after columns with the values of the options."""
        import pandas as pd

        tables = [study.main_table for study in self.studies]
        frames = []
        for study, table in zip(self.studies, tables, strict=True):
            frame = table.frame.copy()
            if "segmenter" in frame and any(option.startswith("segmenter.") for option in self.options):
                frame["segmenter"] = [str(name).partition(" (")[0] for name in frame["segmenter"]]
            for i, option in enumerate(self.options):
                frame.insert(i, option, _value(study.swept[option]))
            frames.append(frame)
        widest = max(tables, key=lambda table: len(table.columns) + (table.published is not None))
        frame = pd.concat(frames, ignore_index=True)
        swept = [_column(name, frame) for name in self.options]
        return widest.replace(name=self.stem, frame=frame, columns=(*swept, *widest.columns))


def sweeps_of(studies: Iterable[Results]) -> list[Sweep]:
    """The sweeps that stored studies belong to, each of at least two studies."""
    groups: dict[Any, list[Results]] = {}
    for study in studies:
        if study.swept and len(study.rows):
            groups.setdefault((study.folder.parent, study.name, tuple(sorted(study.swept))), []).append(study)
    return [Sweep(sorted(group, key=_order), tuple(group[0].swept)) for group in groups.values() if len(group) > 1]


def read_sweeps(folders: Iterable[Path]) -> list[Sweep]:
    """The sweeps that the studies in folders belong to; folders that cannot be read are left out."""
    studies = []
    for folder in folders:
        with suppress(Exception):  # whatever a file leads to that a study did not write
            studies.append(Results.load(folder))
    return sweeps_of(studies)


def write_sweep(sweep: Sweep, console: Console) -> None:
    """Write the table and the curve of a sweep to the folder above those of its studies, and print the table."""
    from studies.figures import charts, drawing

    table = sweep.table
    with atomic_write(sweep.file(".csv")) as path:
        table.frame.to_csv(path, index=False, float_format="%.6g")
    title = f"{sweep.title}, by {' and '.join(sweep.options)}"
    with atomic_write(sweep.file(".md")) as path:
        path.write_text(encodable(markdown_page(title, table)), "utf-8")
    with atomic_write(sweep.file(".tex")) as path:
        path.write_text(encodable(latex(table, title)), "utf-8")
    chart = charts.swept_curve(table, sweep.options, title)
    if chart is not None:
        drawing.save(drawing.draw(chart), sweep.file(".png"))
    print_table(title, table, console)
    console.print(f"written to {sweep.file('.csv')}", highlight=False, soft_wrap=True)


def _column(option: str, frame: pd.DataFrame) -> Column:
    """The column with the values of an option."""
    is_number = frame[option].map(lambda value: isinstance(value, int | float)).all()
    return Column(name=option, heading=option, format="g" if is_number else "", help="Value of the option.")


def _value(text: str) -> Any:
    """The value of an option as it is typed: a number, or the text."""
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        return text
    return value if isinstance(value, int | float) and not isinstance(value, bool) else text


def _order(study: Results) -> list[Any]:
    values: Mapping[str, Any] = {option: _value(text) for option, text in study.swept.items()}
    return [(isinstance(value, str), value) for value in values.values()]
