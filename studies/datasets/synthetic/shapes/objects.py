"""A chair, a cup with a handle, a pair of pliers and a tree."""

from math import cos, radians, sin

from studies.datasets.synthetic.skeleton import Joint, Lathe, Limb, Plate, Shape, Triple, Tube, about, mirrored


def chair() -> Shape:
    """A chair with spindles, and one that leans back."""
    seat = Plate(
        name="seat",
        points=[(0.38, 0, 0.38), (-0.38, 0, 0.38), (0.36, 0, -0.36), (-0.36, 0, -0.36)],
        radii=[0.06] * 4,
        triangles=[(0, 1, 2), (1, 3, 2)],
        parts="seat",
        varied=False,
    )
    edge, corner, top = ("seat", 0), ("seat", 2), ("left post", 1)
    front = _rod("left front leg", (0.34, -0.02, 0.33), (0.42, -0.9, 0.42), (0.065, 0.045), "left front leg", edge)
    rear = _rod("left rear leg", (0.32, -0.02, -0.31), (0.4, -0.9, -0.44), (0.065, 0.045), "left rear leg", corner)
    post = _rod("left post", (0.34, 0.02, -0.36), (0.38, 1.02, -0.54), (0.055, 0.05), "back", corner)
    crest = _rod("crest", (0.38, 1.0, -0.537), (-0.38, 1.0, -0.537), (0.075, 0.075), "back", top)
    rail = _rod("rail", (0.352, 0.32, -0.414), (-0.352, 0.32, -0.414), (0.045, 0.045), "back", top)
    spindle = _rod("left spindle", (0.13, 0.32, -0.414), (0.13, 1.0, -0.537), (0.042, 0.042), "back", top)
    limbs: list[Limb] = [seat]
    for limb in (front, rear, post):
        limbs += [limb, mirrored(limb)]
    leaning = {
        "left post": {0: (-24, 0, 0)},
        "right post": {0: (-24, 0, 0)},
        "left front leg": {0: (-6, 0, 4)},
        "right front leg": {0: (-6, 0, -4)},
        "left rear leg": {0: (16, 0, 4)},
        "right rear leg": {0: (16, 0, -4)},
    }
    limbs += [crest, rail, spindle, mirrored(spindle)]
    return Shape(name="chair", limbs=limbs, poses=[leaning], blend=0.02, genus=4)


def _rod(name: str, start: Triple, end: Triple, radii: tuple[float, float], part: str, joint: Joint) -> Tube:
    """A straight limb whose length does not vary, since others are attached to it."""
    return Tube(name=name, points=[start, end], radii=radii, parts=part, joint=joint, subdivisions=1, varied=False)


def cup() -> Shape:
    """A cup with a handle, and one whose handle is turned aside."""
    bowl = Lathe(
        name="bowl",
        points=[(0, 0, 0)],
        profile=[(0, -0.5), (0.26, -0.5), (0.4, -0.41), (0.47, -0.12), (0.49, 0.2), (0.52, 0.5)],
        radii=[0.075, 0.075, 0.07, 0.066, 0.062, 0.06],
        part="bowl",
        varied=False,
    )
    handle = Tube(
        name="handle",
        points=[(0.53, 0.29, 0), (0.72, 0.34, 0), (0.93, 0.2, 0), (0.93, -0.06, 0), (0.74, -0.26, 0), (0.5, -0.27, 0)],
        radii=[0.055, 0.068, 0.075, 0.075, 0.068, 0.055],
        parts="handle",
        joint=("bowl", 0),
        varied=False,
    )
    # About the line through both ends, which therefore stay where they are.
    aside = {"handle": {0: about(handle.points[0], handle.points[-1], 40)}}
    return Shape(name="cup", limbs=[bowl, handle], poses=[aside], genus=1)


def pliers() -> Shape:
    """A pair of pliers, lying on a table: half open, and wide open."""
    joint = Lathe(
        name="joint",
        points=[(0, 0, 0)],
        profile=[(0, 0), (0.1, 0)],
        radii=[0.115, 0.085],
        part="joint",
        varied=False,
    )
    handle = Tube(
        name="left handle",
        points=[(0, 0, 0), (0.08, 0, -0.13), (0.19, 0, -0.29), (0.27, 0, -0.53), (0.3, 0, -0.8), (0.24, 0, -1.1)],
        radii=[0.08, 0.08, 0.076, 0.08, 0.085, 0.07],
        parts="left handle",
        joint=("joint", 0),
    )
    jaw = Tube(
        name="left jaw",
        points=[(0, 0, 0), (0.08, 0, 0.12), (0.14, 0, 0.26), (0.15, 0, 0.48), (0.085, 0, 0.82)],
        radii=[0.08, 0.088, 0.086, 0.075, 0.045],
        parts="left jaw",
        joint=("joint", 0),
    )
    left: list[Limb] = [handle, jaw]
    # The left handle and the right jaw are one piece, and turn by the same angle about the joint.
    wide = {
        "left handle": {0: (0, -17, 0)},
        "right jaw": {0: (0, -17, 0)},
        "right handle": {0: (0, 17, 0)},
        "left jaw": {0: (0, 17, 0)},
    }
    return Shape(name="pliers", limbs=[joint, *left, *map(mirrored, left)], poses=[wide])


def tree() -> Shape:
    """A tree with six clumps of leaves, and one in the wind."""
    trunk = Tube(
        name="trunk",
        points=[(0, -0.95, 0), (0, -0.6, 0.02), (0.02, -0.25, 0), (-0.01, 0.1, -0.01), (0.0, 0.4, 0), (0.02, 0.62, 0)],
        radii=[0.16, 0.12, 0.115, 0.11, 0.09, 0.075],
        parts="trunk",
        varied=False,
    )
    top = Tube(
        name="top",
        points=[(0.02, 0.8, 0), (0.04, 0.97, 0.03)],
        radii=[0.27, 0.24],
        parts="top leaves",
        joint=("trunk", 5),
    )
    limbs: list[Limb] = [trunk, top]
    for i in range(4):
        x, z = _direction(90 * i + 20)
        limbs.append(
            Tube(
                name=f"root {i + 1}",
                points=[(0, -0.88, 0), (0.17 * x, -0.93, 0.17 * z), (0.34 * x, -1.0, 0.34 * z)],
                radii=[0.1, 0.08, 0.05],
                parts="trunk",
                joint=("trunk", 0),
            )
        )
    windy = {"trunk": {1: (0, 0, -5), 2: (0, 0, -6), 3: (0, 0, -8), 4: (0, 0, -8)}, "top": {0: (0, 0, -4)}}
    for i in range(5):
        x, z = _direction(72 * i + 54)
        low = (-0.16, 0.06, -0.06, 0.12, -0.12)[i]
        name = f"branch {i + 1}"
        limbs.append(
            Tube(
                name=name,
                points=[
                    (0, low, 0),
                    (0.22 * x, low + 0.1, 0.22 * z),
                    (0.46 * x, low + 0.2, 0.46 * z),
                    (0.62 * x, low + 0.36, 0.62 * z),
                ],
                radii=[0.055, 0.056, 0.054, 0.05],
                parts=name,
                joint=("trunk", 3),
            )
        )
        limbs.append(
            Tube(
                name=f"leaves {i + 1}",
                points=[
                    (0.66 * x + 0.1 * z, low + 0.44, 0.66 * z - 0.1 * x),
                    (0.76 * x, low + 0.54, 0.76 * z),
                    (0.72 * x - 0.12 * z, low + 0.46, 0.72 * z + 0.12 * x),
                ],
                radii=[0.19, 0.23, 0.19],
                parts=f"leaves {i + 1}",
                joint=(name, 3),
            )
        )
        windy[name] = {0: (0, -6, -4), 1: (0, -6, -6), 2: (0, -6, -10)}
    return Shape(name="tree", limbs=limbs, poses=[windy])


def _direction(angle: float) -> tuple[float, float]:
    """Cosine and sine of an angle in degrees."""
    return cos(radians(angle)), sin(radians(angle))
