"""A person, and a hand."""

from math import cos, radians, sin

from studies.datasets.synthetic.skeleton import Limb, Plate, Shape, Tube, mirrored


def biped() -> Shape:
    """A person who stands with the arms held off, and one who walks and waves."""
    torso = Plate(
        name="torso",
        points=[
            (0.09, -0.04, 0), (-0.09, -0.04, 0), (0.075, 0.18, 0.01), (-0.075, 0.18, 0.01),
            (0.11, 0.4, 0.01), (-0.11, 0.4, 0.01), (0.15, 0.53, 0), (-0.15, 0.53, 0), (0, 0.56, 0),
        ],
        radii=[0.125, 0.125, 0.105, 0.105, 0.125, 0.125, 0.08, 0.08, 0.09],
        triangles=[(0, 1, 2), (1, 3, 2), (2, 3, 4), (3, 5, 4), (4, 5, 6), (5, 7, 6), (6, 7, 8)],
        parts="torso",
        varied=False,
    )  # fmt: skip
    head = Tube(
        name="head",
        points=[(0, 0.56, 0), (0, 0.66, 0.005), (0, 0.77, 0.025), (0, 0.87, 0.01)],
        radii=[0.075, 0.06, 0.108, 0.128],
        parts="head",
        joint=("torso", 8),
    )
    arm = Tube(
        name="left arm",
        points=[(0.17, 0.52, 0), (0.45, 0.3, -0.02), (0.67, 0.06, 0.03), (0.73, -0.03, 0.05), (0.8, -0.14, 0.07)],
        radii=[0.08, 0.058, 0.043, 0.058, 0.038],
        parts=["left upper arm", "left forearm", "left hand", "left hand"],
        joint=("torso", 6),
    )
    leg = Tube(
        name="left leg",
        points=[(0.11, -0.08, 0), (0.16, -0.5, 0.02), (0.175, -0.66, -0.005), (0.19, -0.92, -0.03)],
        radii=[0.115, 0.075, 0.07, 0.048],
        parts=["left thigh", "left shin", "left shin"],
        joint=("torso", 0),
    )
    foot = Tube(
        name="left foot",
        points=[(0.19, -0.97, -0.05), (0.205, -0.98, 0.08), (0.22, -0.985, 0.18)],
        radii=[0.055, 0.055, 0.042],
        parts="left foot",
        joint=("left leg", 3),
    )
    left: list[Limb] = [arm, leg, foot]
    walking = {
        "torso": {0: (4, 12, 0)},
        "head": {0: (0, 10, 0), 1: (-6, 8, 0)},
        "left arm": {0: (-10, 0, 72), 1: (0, 10, 58), 2: (0, 0, -12)},
        "right arm": {0: (-34, 20, 26), 1: (-62, 0, 0), 2: (-10, 0, 0)},
        "left leg": {0: (-36, 0, 0), 1: (34, 0, 0), 3: (6, 0, 0)},
        "right leg": {0: (22, 0, 0), 1: (34, 0, 0), 3: (16, 0, 0)},
    }
    return Shape(name="biped", limbs=[torso, head, *left, *map(mirrored, left)], poses=[walking])


def hand() -> Shape:
    """A spread left hand, and one that shows two fingers."""
    palm = Plate(
        name="palm",
        points=[
            (0.11, -0.5, 0), (-0.12, -0.5, 0), (0.27, 0.0, 0), (0.09, 0.05, 0), (-0.1, 0.03, 0),
            (-0.27, -0.05, 0), (0.17, -0.36, 0.03),
        ],
        radii=[0.1, 0.1, 0.085, 0.088, 0.086, 0.08, 0.1],
        triangles=[(0, 2, 3), (0, 3, 1), (1, 3, 4), (1, 4, 5), (0, 6, 2)],
        parts="palm",
        varied=False,
    )  # fmt: skip
    wrist = Tube(
        name="wrist",
        points=[(0, -0.5, 0), (0, -0.68, 0), (0, -0.98, 0)],
        radii=[0.14, 0.13, 0.15],
        parts="wrist",
        joint=("palm", 0),
    )
    thumb = Tube(
        name="thumb",
        points=[(0.15, -0.36, 0.03), (0.34, -0.2, 0.07), (0.47, -0.03, 0.1), (0.56, 0.12, 0.11)],
        radii=[0.1, 0.083, 0.07, 0.056],
        parts="thumb",
        joint=("palm", 6),
    )
    fingers = [
        _finger("index finger", (0.27, 0.0, 0), 14, (0.25, 0.19, 0.14), 0.074, 2),
        _finger("middle finger", (0.09, 0.05, 0), 3, (0.28, 0.21, 0.15), 0.077, 3),
        _finger("ring finger", (-0.1, 0.03, 0), -8, (0.25, 0.2, 0.14), 0.073, 4),
        _finger("little finger", (-0.27, -0.05, 0), -21, (0.2, 0.14, 0.11), 0.064, 5),
    ]
    two = {
        "wrist": {0: (0, 0, -10), 1: (0, 0, -10)},
        "thumb": {0: (0, -36, 0), 1: (-6, 0, 22), 2: (0, 0, 26)},
        "index finger": {0: (0, 0, -8)},
        "middle finger": {0: (0, 0, 10)},
        "ring finger": {0: (58, 0, 4), 1: (64, 0, 0), 2: (22, 0, 0)},
        "little finger": {0: (58, 0, 8), 1: (64, 0, 0), 2: (22, 0, 0)},
    }
    return Shape(name="hand", limbs=[palm, wrist, thumb, *fingers], poses=[two], blend=0.02)


def _finger(
    name: str, knuckle: tuple[float, float, float], angle: float, lengths: tuple[float, float, float], radius: float,
    joint: int,
) -> Tube:  # fmt: skip
    """A finger of three bones that points up, and to the left of the hand by an angle in degrees."""
    x, y, z = knuckle
    points = [knuckle]
    for length in lengths:
        x, y = x + length * sin(radians(angle)), y + length * cos(radians(angle))
        points.append((x, y, z))
    radii = [1.08 * radius, radius, 0.9 * radius, 0.74 * radius]
    return Tube(name=name, points=points, radii=radii, parts=name, joint=("palm", joint))
