"""Which meshes the command ``heatwalk`` works on, and where it writes their segments."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from heatwalk.io.ply import comments_of
from heatwalk.io.reading import READABLE, split_suffix
from heatwalk.meshes import MeshError


def meshes_in(paths: Sequence[Path]) -> list[Path]:
    """The meshes that files and folders stand for, each once, in the order given and by name within a folder.

    Parameters
    ----------
    paths : sequence of Path
        a file is taken whatever its name; of a folder the files with a suffix that `heatwalk.read_mesh` reads, without
        those that ``heatwalk segment`` wrote and those in subfolders

    Returns
    -------
    list of Path

    Raises
    ------
    MeshError
        if a folder cannot be read or has no such file

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> for name in ("b.off", "a.obj.gz", "notes.txt"):
    ...     (folder / name).touch()
    >>> [path.name for path in meshes_in([folder, folder / "b.off"])]
    ['a.obj.gz', 'b.off']
    """
    found: dict[Path, Path] = {}
    for path in paths:
        for mesh in _in_folder(path) if path.is_dir() else [path]:
            found.setdefault(mesh.absolute(), mesh)
    return list(found.values())


def outputs_for(meshes: Sequence[Path], folder: Path | None) -> list[Path]:
    """The PLY file for each mesh, in a folder or next to the mesh.

    Parameters
    ----------
    meshes : sequence of Path
    folder : Path or None
        None: next to each mesh

    Returns
    -------
    list of Path
        the name without its suffix, and ``_segments.ply``; with the suffix where two meshes differ in nothing else

    Raises
    ------
    MeshError
        if two meshes have the same name, but not the same folder

    Examples
    --------
    >>> [path.as_posix() for path in outputs_for([Path("a/cat.off"), Path("a/cat.obj"), Path("a/dog.ply.gz")], None)]
    ['a/cat.off_segments.ply', 'a/cat.obj_segments.ply', 'a/dog_segments.ply']
    """
    stems = [(folder or mesh.parent) / split_suffix(mesh.name)[0] for mesh in meshes]
    n_same = Counter(stems)
    outputs = [
        stem.with_name(f"{stem.name if n_same[stem] == 1 else mesh.name}_segments.ply")
        for mesh, stem in zip(meshes, stems, strict=True)
    ]
    taken: dict[Path, Path] = {}
    for mesh, output in zip(meshes, outputs, strict=True):
        if output in taken:
            raise MeshError(f"{taken[output]} and {mesh} would both be written to {output}; segment them one by one")
        taken[output] = mesh
    return outputs


def _in_folder(folder: Path) -> list[Path]:
    """The meshes in a folder, by name, without what was written by this command."""
    try:
        files = sorted(path for path in folder.iterdir() if not path.name.startswith("._"))  # which are of macOS
        meshes = [
            path
            for path in files
            if split_suffix(path.name)[1] and path.is_file() and "heatwalk" not in comments_of(path)
        ]
    except OSError as error:
        raise MeshError(f"{folder}: cannot be read: {error.strerror or error}") from error
    if not meshes:
        raise MeshError(
            f"{folder}: the folder contains no mesh itself (subfolders are not searched); supported: {READABLE}"
        )
    return meshes
