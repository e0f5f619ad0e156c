"""A four-legged animal, an octopus, a bird, a fish, a starfish and a snake."""

from math import cos, degrees, pi, radians, sin

from numpy import linspace
from scipy.interpolate import PchipInterpolator

from studies.datasets.synthetic.skeleton import Lathe, Limb, Plate, Shape, Triple, Tube, Turns, about, mirrored


def quadruped() -> Shape:
    """A dog that stands, and one that walks with its head down."""
    body = Tube(
        name="body",
        points=[(0, 0.2, -0.5), (0, 0.17, -0.15), (0, 0.16, 0.15), (0, 0.2, 0.42)],
        radii=[0.2, 0.19, 0.22, 0.21],
        parts="torso",
    )
    neck = Tube(
        name="neck",
        points=[(0, 0.26, 0.46), (0, 0.48, 0.62), (0, 0.64, 0.7)],
        radii=[0.16, 0.12, 0.11],
        parts="neck",
        joint=("body", 3),
    )
    head = Tube(
        name="head",
        points=[(0, 0.68, 0.7), (0, 0.67, 0.82), (0, 0.6, 0.96), (0, 0.57, 1.08)],
        radii=[0.135, 0.125, 0.08, 0.07],
        parts="head",
        joint=("neck", 2),
    )
    tail = Tube(
        name="tail",
        points=[(0, 0.28, -0.64), (0, 0.4, -0.82), (0, 0.6, -0.94), (0, 0.8, -0.96)],
        radii=[0.075, 0.055, 0.05, 0.042],
        parts="tail",
        joint=("body", 0),
    )
    ear = Tube(
        name="left ear",
        points=[(0.07, 0.76, 0.68), (0.12, 0.86, 0.64), (0.15, 0.95, 0.64)],
        radii=[0.055, 0.05, 0.035],
        parts="head",
        joint=("head", 0),
    )
    front = Tube(
        name="left foreleg",
        points=[
            (0.12, 0.1, 0.42), (0.15, -0.24, 0.34), (0.155, -0.58, 0.38), (0.155, -0.82, 0.37), (0.155, -0.86, 0.46),
        ],
        radii=[0.13, 0.085, 0.056, 0.055, 0.052],
        parts=["left upper foreleg", "left lower foreleg", "left lower foreleg", "left lower foreleg"],
        joint=("body", 3),
    )  # fmt: skip
    rear = Tube(
        name="left hind leg",
        points=[
            (0.12, 0.12, -0.5), (0.16, -0.22, -0.4), (0.16, -0.52, -0.6), (0.16, -0.82, -0.53), (0.16, -0.86, -0.44),
        ],
        radii=[0.15, 0.1, 0.058, 0.055, 0.052],
        parts=["left upper hind leg", "left lower hind leg", "left lower hind leg", "left lower hind leg"],
        joint=("body", 0),
    )  # fmt: skip
    left: list[Limb] = [ear, front, rear]
    walking = {
        "neck": {0: (28, 0, 0), 1: (20, 0, 0)},
        "head": {0: (-14, 0, 0)},
        "tail": {0: (-30, 0, 0), 1: (-16, 16, 0), 2: (10, 0, 0)},
        "left foreleg": {0: (-32, 0, 0), 1: (14, 0, 0), 2: (16, 0, 0)},
        "right foreleg": {0: (22, 0, 0), 1: (10, 0, 0), 2: (10, 0, 0)},
        "left hind leg": {0: (20, 0, 0), 1: (4, 0, 0), 2: (6, 0, 0)},
        "right hind leg": {0: (-20, 0, 0), 1: (10, 0, 0), 2: (4, 0, 0)},
    }
    return Shape(name="quadruped", limbs=[body, neck, head, tail, *left, *map(mirrored, left)], poses=[walking])


def octopus() -> Shape:
    """An octopus with its arms in a whirl, and one that swims."""
    head = Tube(
        name="head",
        points=[(0, 0.08, 0), (0, 0.28, 0), (0, 0.56, -0.07), (0, 0.82, -0.16)],
        radii=[0.14, 0.26, 0.34, 0.26],
        parts="head",
        varied=False,
    )
    eye = Tube(
        name="left eye",
        points=[(0.17, 0.25, 0.19), (0.19, 0.255, 0.21)],
        radii=[0.1, 0.09],
        parts="head",
        joint=("head", 1),
        subdivisions=1,
        varied=False,
    )
    arms: list[Limb] = []
    swimming = {}
    for i in range(8):
        angle = 22.5 + 45 * i
        bends, distances = (0, 4, 12, 24, 36, 46), (0.14, 0.4, 0.66, 0.86, 0.98, 1.04)
        heights = (-0.04, -0.2, -0.28, -0.24, -0.12, 0.04)
        arms.append(
            Tube(
                name=f"arm {i + 1}",
                points=[
                    _around(angle + bend, distance, height)
                    for bend, distance, height in zip(bends, distances, heights, strict=True)
                ],
                radii=[0.125, 0.108, 0.094, 0.08, 0.068, 0.056],
                subdivisions=3,
                parts=f"arm {i + 1}",
                joint=("head", 0),
            )
        )
        x, _, z = _around(angle + 90, 1.0, 0)  # turning about this axis lifts the arm
        lift = -34 if i % 2 else -16
        swimming[f"arm {i + 1}"] = {
            0: (lift * x, 0.0, lift * z),
            2: (-18 * x, 6.0, -18 * z),
            3: (-20 * x, -14.0, -20 * z),
            4: (0.0, -24.0, 0.0),
        }
    limbs = [head, eye, mirrored(eye), *arms]
    return Shape(name="octopus", limbs=limbs, poses=[swimming])


def _around(angle: float, distance: float, height: float) -> Triple:
    """The point at an angle in degrees about the vertical, from x towards z."""
    return distance * cos(radians(angle)), height, distance * sin(radians(angle))


def bird() -> Shape:
    """A bird that glides, and one that beats its wings."""
    body = Tube(
        name="body",
        points=[(0, 0, -0.42), (0, 0, -0.12), (0, 0.01, 0.16), (0, 0.07, 0.36)],
        radii=[0.09, 0.16, 0.175, 0.125],
        parts="body",
    )
    head = Tube(
        name="head",
        points=[(0, 0.11, 0.42), (0, 0.17, 0.54)],
        radii=[0.11, 0.12],
        parts="head",
        joint=("body", 3),
    )
    beak = Tube(
        name="beak",
        points=[(0, 0.16, 0.6), (0, 0.13, 0.78)],
        radii=[0.065, 0.032],
        parts="beak",
        joint=("head", 1),
    )
    tail = Plate(
        name="tail",
        points=[(0, 0, -0.42), (0.2, 0.02, -0.86), (-0.2, 0.02, -0.86), (0, 0.01, -0.8)],
        radii=[0.055, 0.035, 0.035, 0.035],
        triangles=[(0, 1, 3), (0, 3, 2)],
        parts="tail",
        joint=("body", 0),
    )
    inner = Plate(
        name="left inner wing",
        points=[(0.08, 0.07, 0.22), (0.08, 0.05, -0.14), (0.5, 0.16, 0.27), (0.5, 0.12, -0.17)],
        radii=[0.065, 0.04, 0.05, 0.036],
        triangles=[(0, 1, 2), (1, 3, 2)],
        parts="left inner wing",
        joint=("body", 2),
    )
    outer = Plate(
        name="left outer wing",
        points=[(0.5, 0.16, 0.27), (0.5, 0.12, -0.17), (0.82, 0.13, 0.2), (0.86, 0.1, -0.2), (1.12, 0.08, -0.08)],
        radii=[0.05, 0.036, 0.042, 0.034, 0.034],
        triangles=[(0, 1, 3), (0, 3, 2), (2, 3, 4)],
        parts="left outer wing",
        joint=("left inner wing", 2),
    )
    left: list[Limb] = [inner, outer]
    beating: Turns = {
        "head": {0: (8, 18, 0)},
        "tail": {0: (14, 0, 0)},
        "left inner wing": {0: (0, 0, 40)},
        "right inner wing": {0: (0, 0, -40)},
        # About the edge between the wings, where they stay joined.
        "left outer wing": {0: about((0.5, 0.16, 0.27), (0.5, 0.12, -0.17), 28)},
        "right outer wing": {0: about((-0.5, 0.12, -0.17), (-0.5, 0.16, 0.27), 28)},
    }
    return Shape(name="bird", limbs=[body, head, beak, tail, *left, *map(mirrored, left)], poses=[beating], blend=0.025)


def fish() -> Shape:
    """A fish, and one that turns."""
    along = linspace(0.84, -0.74, 14)
    nodes = [-0.74, -0.5, -0.2, 0.14, 0.46, 0.7, 0.84]
    above = PchipInterpolator(nodes, [0.02, 0.06, 0.18, 0.26, 0.2, 0.08, 0.0])(along).tolist()
    below = PchipInterpolator(nodes, [-0.02, -0.06, -0.16, -0.23, -0.19, -0.09, -0.02])(along).tolist()
    thickness = PchipInterpolator(nodes, [0.05, 0.056, 0.088, 0.12, 0.118, 0.09, 0.065])(along).tolist()
    count, gills = len(along), 3
    spine = Tube(
        name="spine",
        points=[(0, 0, z) for z in along.tolist()],
        radii=thickness,
        parts=["head"] * gills + ["body"] * (count - 1 - gills),
        subdivisions=1,
        varied=False,
    )
    rows = zip(above, below, along.tolist(), strict=True)
    flanks = Plate(
        name="flanks",
        points=[(0, y, z) for up, down, z in rows for y in (up, down)],
        radii=[radius for radius in thickness for _ in range(2)],
        triangles=[
            corners for i in range(0, 2 * count - 2, 2) for corners in ((i, i + 1, i + 2), (i + 1, i + 3, i + 2))
        ],
        parts=["head"] * (2 * gills) + ["body"] * (2 * (count - 1 - gills)),
        joints=[("spine", i) for i in range(count) for _ in range(2)],
    )
    eye = Tube(
        name="left eye",
        points=[(0.075, 0.08, 0.66), (0.08, 0.08, 0.665)],
        radii=[0.05, 0.048],
        parts="head",
        joint=("spine", 1),
        subdivisions=1,
        varied=False,
    )
    tail = Plate(
        name="tail fin",
        points=[(0, 0, -0.7), (0, 0.36, -1.06), (0, 0, -0.9), (0, -0.36, -1.06)],
        radii=[0.05, 0.036, 0.034, 0.036],
        triangles=[(0, 1, 2), (0, 2, 3)],
        parts="tail fin",
        joint=("spine", 13),
    )
    back = Plate(
        name="dorsal fin",
        points=[(0, 0.3, 0.26), (0, 0.52, 0.02), (0, 0.46, -0.16), (0, 0.2, -0.28)],
        radii=[0.042, 0.036, 0.034, 0.04],
        triangles=[(0, 1, 3), (1, 2, 3)],
        parts="dorsal fin",
        joints=[("spine", 5), ("spine", 7), ("spine", 8), ("spine", 9)],
    )
    anal = Plate(
        name="anal fin",
        points=[(0, -0.2, -0.16), (0, -0.4, -0.36), (0, -0.12, -0.42)],
        radii=[0.042, 0.034, 0.04],
        triangles=[(0, 1, 2)],
        parts="anal fin",
        joint=("spine", 8),
    )
    pectoral = Plate(
        name="left pectoral fin",
        points=[(0.08, -0.1, 0.36), (0.34, -0.24, 0.16), (0.36, -0.12, 0.04)],
        radii=[0.05, 0.036, 0.034],
        triangles=[(0, 1, 2)],
        parts="left pectoral fin",
        joint=("spine", 4),
    )
    turning: Turns = {
        "spine": {i: (0, 9 if i < 9 else -14, 0) for i in range(3, 12)},
        "tail fin": {0: (0, -12, 0)},
        "left pectoral fin": {0: (0, 16, 20)},
        "right pectoral fin": {0: (0, 10, 24)},
    }
    limbs = [spine, flanks, eye, mirrored(eye), tail, back, anal, pectoral, mirrored(pectoral)]
    return Shape(name="fish", limbs=limbs, poses=[turning], blend=0.02)


def star() -> Shape:
    """A starfish that lies on the ground, and one that crawls."""
    body = Lathe(
        name="body",
        points=[(0, 0, 0)],
        profile=[(0, 0.02), (0.12, 0.0), (0.2, 0.0)],
        radii=[0.2, 0.18, 0.15],
        part="body",
        varied=False,
    )
    arms: list[Limb] = []
    crawling = {}
    for i in range(5):
        angle = 72 * i - 90
        x, _, z = _around(angle, 1.0, 0.0)
        arms.append(
            Tube(
                name=f"arm {i + 1}",
                points=[_around(angle, distance, 0.0) for distance in (0.15, 0.4, 0.7, 1.0)],
                radii=[0.17, 0.155, 0.115, 0.065],
                parts=f"arm {i + 1}",
                joint=("body", 0),
            )
        )
        bend, lift = (16, -14, 22, 16, -20)[i], (0, -16, 0, -24, 0)[i]
        crawling[f"arm {i + 1}"] = {1: (-lift * z, bend, lift * x), 2: (lift * z, 1.6 * bend, -lift * x)}
    return Shape(name="star", limbs=[body, *arms], poses=[crawling])


def snake() -> Shape:
    """A snake that winds over the ground, and one that has coiled up and raised its head."""
    count, step = 36, 0.15
    headings = [66 * cos(2 * pi * i / 12) for i in range(count)]  # in degrees from z towards x
    points: list[Triple] = [(-0.3, 0.0, -1.8)]
    for heading in headings:
        x, y, z = points[-1]
        points.append((x + step * sin(radians(heading)), y, z + step * cos(radians(heading))))
    radii = [min(0.042 + 0.005 * i, 0.1, 0.1 - 0.005 * (i - 30)) for i in range(count + 1)]
    body = Tube(name="body", points=points, radii=radii, parts=["tail"] * 9 + ["body"] * (count - 9), subdivisions=2)
    x, y, z = points[-1]
    ahead, aside = cos(radians(headings[-1])), sin(radians(headings[-1]))
    head = Tube(
        name="head",
        points=[(x + far * aside, y, z + far * ahead) for far in (0.0, 0.1, 0.22, 0.34)],
        radii=[0.07, 0.115, 0.11, 0.058],
        parts="head",
        joint=("body", count),
    )
    # The coil: a spiral from the tail inwards, whose turns stay apart; then the neck rises in its middle, straight.
    turns: dict[int, list[float]] = {}
    radius = 0.72
    for i in range(count):
        wanted = degrees(step / radius) if 0 < i < 28 else 0.0
        turns[i] = [0.0, wanted - headings[i] + headings[max(i - 1, 0)], 0.0]
        radius = max(radius - 0.28 * wanted / 360, 0.26)
    for i, angle in {27: -22, 28: -28, 29: -26, 30: -14, 32: 16, 33: 26, 34: 26, 35: 20}.items():
        across = radians(headings[i])  # the axis to turn about is horizontal, and at a right angle to the body
        turns[i][0] += angle * cos(across)
        turns[i][2] -= angle * sin(across)
    across = radians(headings[-1])
    nod = {0: (12 * cos(across), 0.0, -12 * sin(across))}
    return Shape(name="snake", limbs=[body, head], poses=[{"body": turns, "head": nod}])
