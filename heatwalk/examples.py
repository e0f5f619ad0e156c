"""Meshes to try the method on, which the packages that this one requires contain."""

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from heatwalk.meshes import MeshError

# By name: the distribution that contains the mesh, and its path there.
EXAMPLES = {
    "cow": ("pymeshlab", "pymeshlab/tests/sample_meshes/cow.obj"),
    "bunny": ("pymeshlab", "pymeshlab/tests/sample_meshes/bunny.obj"),
    "ant": ("pyvista", "pyvista/examples/ant.ply"),
}


def example_path(name: str = "cow") -> Path:
    """The file of an example: a cow of 2,904 vertices, a bunny of 28,088, or an ant of 486 in 15 pieces.

    Parameters
    ----------
    name : str
        "cow", "bunny" or "ant"

    Returns
    -------
    Path

    Raises
    ------
    MeshError
        if there is no example of this name, or the package that contains it is not installed as it should be

    Examples
    --------
    >>> example_path("ant").name
    'ant.ply'
    """
    if name not in EXAMPLES:
        raise MeshError(f"there is no example {name!r}; there are {', '.join(EXAMPLES)}")
    package, file = EXAMPLES[name]
    try:
        path = Path(str(distribution(package).locate_file(file)))
    except PackageNotFoundError as error:
        raise MeshError(f"the example {name!r} is part of the package {package}, which is not installed") from error
    if not path.is_file():
        raise MeshError(f"the example {name!r} is part of the package {package}, whose installation has no {path}")
    return path
