"""Any program that reads a mesh file and writes labels, as a segmenter."""

import hashlib
import re
import shlex
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from studies.execution.process_tree import supervised

TAIL = 300  # characters of what a program printed last that an error quotes


@dataclass(frozen=True)
class External:
    """A program: it reads a mesh, and writes one label, an integer, a line, for each vertex or each face.

    command : the program and its arguments, quoted as in a shell, but not given to one; ``{mesh}`` and ``{labels}``
        stand for the paths of the mesh that it reads and of the file that it writes
    suffix : of the mesh file, which says its format: ``.off``, ``.obj`` or ``.ply`` (ASCII, double precision);
        coordinates are written to their last digit, vertices and faces in their order

    It runs in the folder where the study was started, with a temporary folder for the two files. It ends with the
    process that runs the trial, whatever ends that.

    Raises ValueError for a command without program, ``{mesh}`` or ``{labels}``, and for an unknown suffix; and, when it
    is called, for a program that fails, writes no labels, or writes a line that is no integer.
    """

    command: str
    suffix: str = ".off"

    def __post_init__(self):
        for place in ("{mesh}", "{labels}"):
            if not any(place in word for word in self.words):
                raise ValueError(
                    f"segmenter.command={self.command!r} does not say where {place} goes: "
                    "segmenter.command='mytool {mesh} {labels}'"
                )
        if self.suffix not in WRITERS:
            raise ValueError(f"segmenter.suffix is {self.suffix!r}: give one of {', '.join(WRITERS)}")
        if shutil.which(self.words[0]) is None:
            raise ValueError(f"segmenter.command={self.command!r}: there is no program {self.words[0]!r} to be run")

    @cached_property
    def words(self):
        try:
            return shlex.split(self.command)
        except ValueError as error:
            raise ValueError(f"segmenter.command={self.command!r}: {error}") from error

    @property
    def name(self):
        """The command without its folders and without the files of each call: ``python3 mytool.py --parts 5``."""
        return " ".join(Path(word).name for word in self.words if "{mesh}" not in word and "{labels}" not in word)

    @property
    def algorithm_version(self):
        """SHA-256 of the program's file, and of every other file that the command names."""
        digest = hashlib.sha256()
        for path in [shutil.which(self.words[0]), *self.words[1:]]:
            if Path(path).is_file():
                with open(path, "rb") as file:
                    digest.update(hashlib.file_digest(file, "sha256").digest())
        return digest.hexdigest()

    def __call__(self, vertices, faces):
        # The supervisor may have removed the folder already.
        with tempfile.TemporaryDirectory(prefix="segmenter-", ignore_cleanup_errors=True) as folder:
            mesh, labels, printed = (Path(folder, name) for name in (f"mesh{self.suffix}", "labels.txt", "printed.txt"))
            WRITERS[self.suffix](mesh, vertices, faces)
            words = [word.replace("{mesh}", str(mesh)).replace("{labels}", str(labels)) for word in self.words]
            # Into a file: a pipe would have to be emptied, and would stay open as long as anything holds it.
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
                raise ValueError(f"{self.name} ended with exit code {code}{_said(printed)}")
            if not labels.is_file():
                raise ValueError(f"{self.name} wrote no file {{labels}}{_said(printed)}")
            lines = labels.read_text("utf-8", errors="replace").rstrip().splitlines()
            for number, line in enumerate(lines, start=1):
                if not re.fullmatch(r"\s*[+-]?[0-9]{1,18}\s*", line, re.ASCII):
                    raise ValueError(
                        f"{self.name}: line {number} of its labels is no integer: {line[:40]!r}{_said(printed)}"
                    )
            return np.array(lines, dtype=np.int64)


def _said(printed):
    """The end of what a program printed, as the end of a sentence about it."""
    with printed.open("rb") as file:
        file.seek(max(0, printed.stat().st_size - TAIL))
        tail = " ".join(file.read().decode("utf-8", errors="replace").split())
    return f"; the last it printed: {tail}" if tail else ", and printed nothing"


def _write_off(path, vertices, faces):
    with path.open("w") as file:
        file.write(f"OFF\n{len(vertices)} {len(faces)} 0\n")
        _write_rows(file, vertices, faces)


def _write_ply(path, vertices, faces):
    with path.open("w") as file:
        file.write(
            f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\n"
            "property double x\nproperty double y\nproperty double z\n"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
        )
        _write_rows(file, vertices, faces)


def _write_rows(file, vertices, faces):
    np.savetxt(file, vertices, fmt="%.17g")
    np.savetxt(file, faces, fmt="3 %d %d %d")


def _write_obj(path, vertices, faces):
    with path.open("w") as file:
        np.savetxt(file, vertices, fmt="v %.17g %.17g %.17g")
        np.savetxt(file, faces + 1, fmt="f %d %d %d")


WRITERS = {".off": _write_off, ".obj": _write_obj, ".ply": _write_ply}
