"""Any program that reads a mesh file and writes labels, as a segmenter."""

from __future__ import annotations

import hashlib
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heatwalk.io import parse_integers
from heatwalk.io.obj import write_obj
from heatwalk.io.off import write_off
from heatwalk.io.ply import write_text_ply
from studies.execution.process_tree import supervised

TAIL = 300  # characters at the end of a program's output that an error message quotes


@dataclass(frozen=True)
class External:
    """A program that reads a mesh and writes one label, an integer, per line, for each vertex or each face.

    Parameters
    ----------
    command : str
        the program and its arguments, quoted as in a POSIX shell, which is not involved; ``{mesh}`` and ``{labels}``
        are replaced by the paths of the mesh file and of the file for the labels
    suffix : {".off", ".obj", ".ply"}
        suffix of the mesh file, which determines its format (PLY: ASCII, double precision). Coordinates are written
        with all their digits, vertices and faces in their order.

    Raises
    ------
    ValueError
        If the command lacks ``{mesh}`` or ``{labels}``, its program cannot be found, or the suffix is unknown.

    Notes
    -----
    The program runs in the folder in which the study was started; a temporary folder contains the two files. It ends
    with the process that runs the trial, however that ends.

    Examples
    --------
    >>> import sys
    >>> External(f"'{sys.executable}' mytool.py {{mesh}} {{labels}} --parts 5").name.split()[1:]
    ['mytool.py', '--parts', '5']
    """

    command: str
    suffix: str = ".off"

    def __post_init__(self) -> None:
        if not isinstance(self.command, str):
            raise ValueError(f"segmenter.command is {self.command!r}: it must be text: 'mytool {{mesh}} {{labels}}'")
        for placeholder in ("{mesh}", "{labels}"):
            if not any(placeholder in word for word in self.words):
                raise ValueError(
                    f"segmenter.command={self.command!r} lacks {placeholder}: "
                    "segmenter.command='mytool {mesh} {labels}'"
                )
        if self.suffix not in WRITERS:
            raise ValueError(f"segmenter.suffix is {self.suffix!r}: choose one of {', '.join(WRITERS)}")
        if shutil.which(self.words[0]) is None:
            raise ValueError(f"segmenter.command={self.command!r}: the program {self.words[0]!r} cannot be found")

    @cached_property
    def words(self) -> list[str]:
        """The program and its arguments."""
        try:
            return shlex.split(self.command)
        except ValueError as error:
            raise ValueError(f"segmenter.command={self.command!r}: {error}") from error

    @property
    def name(self) -> str:
        """The command without folders and without the two files: ``python3 mytool.py --parts 5``."""
        return " ".join(Path(word).name for word in self.words if "{mesh}" not in word and "{labels}" not in word)

    @property
    def algorithm_version(self) -> str:
        """SHA-256 of the program's file and of every other file that the command names."""
        digest = hashlib.sha256()
        for path in [shutil.which(self.words[0]) or self.words[0], *self.words[1:]]:
            if Path(path).is_file():
                with open(path, "rb") as file:
                    digest.update(hashlib.file_digest(file, "sha256").digest())
        return digest.hexdigest()

    def __call__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
        """The labels that the program writes.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face

        Returns
        -------
        (p,) int64 array
            one per line of the file

        Raises
        ------
        ValueError
            If the program fails, writes no labels, or writes a line that is not an integer.
        """
        # The supervisor may have removed the folder already.
        with tempfile.TemporaryDirectory(prefix="segmenter-", ignore_cleanup_errors=True) as folder:
            mesh, labels, printed = (Path(folder, name) for name in (f"mesh{self.suffix}", "labels.txt", "printed.txt"))
            WRITERS[self.suffix](mesh, vertices, faces)
            words = [word.replace("{mesh}", str(mesh)).replace("{labels}", str(labels)) for word in self.words]
            # Output goes to a file: a pipe would have to be emptied, and stays open as long as any process uses it.
            with (
                printed.open("wb") as sink,
                subprocess.Popen(
                    supervised(words, folder),
                    stdin=subprocess.PIPE,
                    stdout=sink,
                    stderr=subprocess.STDOUT,
                ) as process,
            ):
                code = process.wait()
            if code:
                raise ValueError(f"{self.name} ended with exit code {code}{_output_of(printed)}")
            if not labels.is_file():
                raise ValueError(f"{self.name} wrote no file {{labels}}{_output_of(printed)}")
            try:
                return parse_integers(labels.read_text("utf-8", errors="replace"), "a label (an integer)", signed=True)
            except ValueError as error:
                raise ValueError(f"{self.name}: {error}{_output_of(printed)}") from error


def _output_of(printed: Path) -> str:
    """The end of a program's output, as the end of a sentence about the program."""
    with printed.open("rb") as file:
        file.seek(max(0, printed.stat().st_size - TAIL))
        tail = " ".join(file.read().decode("utf-8", errors="replace").split())
    return f"; the end of its output: {tail}" if tail else ", without any output"


WRITERS: dict[str, Callable[[Path, NDArray, NDArray], None]] = {
    ".off": write_off,
    ".obj": write_obj,
    ".ply": write_text_ply,
}
