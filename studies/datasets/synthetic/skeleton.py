"""A shape as limbs that hang on each other's joints: posed by turning joints, varied by stretching limbs."""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from scipy.spatial.transform import Rotation

from studies.datasets.synthetic.solids import Array, Cones, Lathed, Solid, Triangles

Joint = tuple[str, int]  # a limb, and which of its points
Turns = Mapping[str, Mapping[int, Sequence[float]]]  # limb → point → rotation vector in degrees, axes of the rest pose
Triple = tuple[float, float, float]

SUBDIVISIONS = 4  # of a span of a tube: pieces differ by 20 degrees at most where it bends by a right angle
LATHE_SUBDIVISIONS = 6

# Of the logarithms of what a seed varies: lengths and radii by 8 % each way at most, the axes of the whole by 5 %.
LARGEST_VARIATION = 0.08
LARGEST_STRETCH = 0.05


@dataclass(frozen=True)
class Frames:
    """Where the points of a limb are in a pose, and how what lies beyond each of them is turned.

    Parameters
    ----------
    points : (n, 3) float array
    rotations : (n, 3, 3) float array
    """

    points: Array
    rotations: Array


@dataclass(frozen=True, kw_only=True)
class Limb(ABC):
    """Some points that move together, and the solid around them.

    Parameters
    ----------
    name : str
        unique in the shape; "left" and "right" limbs are varied alike
    points : sequence of (x, y, z)
        in the rest pose: x to the right, y up, z towards the viewer; about 2 is the size of a shape
    radii : sequence of float
        of the ball around each point
    joint : (str, int), optional
        the point of another limb, listed before, with which this one moves
    varied : bool
        whether a seed may stretch the limb about its first point; false where both of its ends are attached
    """

    name: str
    points: Sequence[Triple]
    radii: Sequence[float]
    joint: Joint | None = None
    varied: bool = True

    @abstractmethod
    def part_names(self) -> Sequence[str]:
        """The names of its parts, of one piece each or of several in a row."""

    @abstractmethod
    def solid(self, frames: Frames, rest: Frames, number: Mapping[str, int]) -> Solid:
        """The solid in a pose; ``number`` has the label of each part."""

    def posed(self, base: tuple[Array, Array, Array], turns: Mapping[int, Sequence[float]]) -> Frames:
        """The points when joints are turned; ``base`` is where the joint it hangs on was and is, and its rotation."""
        before, after, rotation = base
        points = np.array(self.points, dtype=float)
        placed, rotations = np.empty_like(points), np.empty((len(points), 3, 3))
        previous, place = before, after
        for i, point in enumerate(points):
            place = place + rotation @ (point - previous)
            previous = point
            if i in turns:
                rotation = rotation @ Rotation.from_rotvec(turns[i], degrees=True).as_matrix()
            placed[i], rotations[i] = place, rotation
        return Frames(placed, rotations)


@dataclass(frozen=True, kw_only=True)
class Tube(Limb):
    """A chain of round cones through the points.

    Parameters
    ----------
    parts : str or sequence of str
        the part of each span between two points
    subdivisions : int
        pieces of a smooth curve between two points; 1 for straight lines from one to the next
    """

    parts: str | Sequence[str]
    subdivisions: int = SUBDIVISIONS

    def part_names(self) -> Sequence[str]:
        """See `Limb.part_names`."""
        spans = len(self.points) - 1
        return [self.parts] * spans if isinstance(self.parts, str) else self.parts

    def solid(self, frames: Frames, rest: Frames, number: Mapping[str, int]) -> Cones:
        """See `Limb.solid`."""
        count = self.subdivisions
        points, radii = _refined(frames.points, np.array(self.radii), count)
        original, _ = _refined(rest.points, np.array(self.radii), count)
        rotations = np.repeat(frames.rotations[:-1], count, axis=0)
        # The smooth curve turns less abruptly than the spans: each piece is turned into its direction.
        turned = np.einsum("pij,pj->pi", rotations, np.diff(original, axis=0))
        rotations = np.einsum("pij,pjk->pik", _turning(turned, np.diff(points, axis=0)), rotations)
        parts = np.repeat([number[part] for part in self.part_names()], count)
        return Cones(
            parts=parts, origins=points[:-1], rotations=rotations, starts=points[:-1], ends=points[1:],
            radii=np.column_stack([radii[:-1], radii[1:]]),
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Plate(Limb):
    """Round triangles between points: wings, fins, seats.

    Parameters
    ----------
    triangles : sequence of (int, int, int)
        points of each triangle
    parts : str or sequence of str
        the part of each triangle
    joints : sequence of (str, int)
        the point of another limb with which each point moves, instead of ``joint``
    """

    triangles: Sequence[tuple[int, int, int]]
    parts: str | Sequence[str]
    joints: Sequence[Joint] = ()

    def part_names(self) -> Sequence[str]:
        """See `Limb.part_names`."""
        return [self.parts] * len(self.triangles) if isinstance(self.parts, str) else self.parts

    def posed(self, base: tuple[Array, Array, Array], turns: Mapping[int, Sequence[float]]) -> Frames:
        """As a rigid body about its first point, see `Limb.posed`."""
        before, after, rotation = base
        points = np.array(self.points, dtype=float)
        start = after + rotation @ (points[0] - before)
        if 0 in turns:
            rotation = rotation @ Rotation.from_rotvec(turns[0], degrees=True).as_matrix()
        placed = start + np.einsum("ij,nj->ni", rotation, points - points[0])
        return Frames(placed, np.repeat(rotation[None], len(points), axis=0))

    def solid(self, frames: Frames, rest: Frames, number: Mapping[str, int]) -> Triangles:
        """See `Limb.solid`."""
        chosen = np.array(self.triangles)
        corners, original = frames.points[chosen], rest.points[chosen]
        rotations = np.einsum("pij,pkj->pik", _triangle_frames(corners), _triangle_frames(original))
        parts = np.array([number[part] for part in self.part_names()])
        return Triangles(
            parts=parts, origins=corners.mean(axis=1), rotations=rotations, corners=corners,
            radii=np.array(self.radii)[chosen],
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Lathe(Limb):
    """What a chain of round cones sweeps about the vertical through the first point.

    Parameters
    ----------
    profile : sequence of (float, float)
        distance from the axis, and height above the first point; ``radii`` are those along the profile
    part : str
    """

    profile: Sequence[tuple[float, float]]
    part: str

    def part_names(self) -> Sequence[str]:
        """See `Limb.part_names`."""
        return [self.part]

    def solid(self, frames: Frames, rest: Frames, number: Mapping[str, int]) -> Lathed:
        """See `Limb.solid`."""
        path = np.column_stack([np.array(self.profile, dtype=float), np.zeros(len(self.profile))])
        path, radii = _refined(path, np.array(self.radii), LATHE_SUBDIVISIONS)
        path[:, 0] = np.maximum(path[:, 0], 0.0)
        pieces = len(path) - 1
        parts = np.full(pieces, number[self.part])
        origins = np.repeat(frames.points[:1], pieces, axis=0)
        rotations = np.repeat(frames.rotations[:1], pieces, axis=0)
        profile = Cones(
            parts=parts, origins=origins, rotations=rotations, starts=path[:-1], ends=path[1:],
            radii=np.column_stack([radii[:-1], radii[1:]]),
        )  # fmt: skip
        return Lathed(
            parts=parts, origins=origins, rotations=rotations, centre=frames.points[0], frame=frames.rotations[0],
            profile=profile,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A kind of shape.

    Parameters
    ----------
    name : str
    limbs : sequence of Limb
        each after those that it hangs on
    poses : sequence of mapping
        the turned joints of each pose after the first, which is the rest pose
    blend : float
        over which length limbs melt into each other
    genus : int
        how many handles the surface has
    """

    name: str
    limbs: Sequence[Limb]
    poses: Sequence[Turns] = ()
    blend: float = 0.03
    genus: int = 0
    parts: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        names = (part for limb in self.limbs for part in limb.part_names())
        object.__setattr__(self, "parts", tuple(dict.fromkeys(names)))

    def solids(self, pose: int = 1) -> list[Solid]:
        """The solid of each limb in a pose, 1 being the rest pose."""
        number = {part: label for label, part in enumerate(self.parts)}
        rest, posed = self.frames({}), self.frames(self.poses[pose - 2] if pose > 1 else {})
        return [limb.solid(posed[limb.name], rest[limb.name], number) for limb in self.limbs]

    def frames(self, turns: Turns) -> dict[str, Frames]:
        """The points of all limbs when some joints are turned."""
        unknown = set(turns) - {limb.name for limb in self.limbs}
        if unknown:
            raise ValueError(f"shape {self.name}: a pose turns {', '.join(sorted(unknown))}, which is not a limb")
        rest_points = {limb.name: np.array(limb.points, dtype=float) for limb in self.limbs}
        frames: dict[str, Frames] = {}

        def base(joint: Joint | None) -> tuple[Array, Array, Array]:
            if joint is None:
                return np.zeros(3), np.zeros(3), np.eye(3)
            limb, i = joint
            return rest_points[limb][i], frames[limb].points[i], frames[limb].rotations[i]

        for limb in self.limbs:
            own = turns.get(limb.name, {})
            if isinstance(limb, Plate) and limb.joints:
                frames[limb.name] = _carried(rest_points[limb.name], [base(joint) for joint in limb.joints])
            else:
                frames[limb.name] = limb.posed(base(limb.joint), own)
        return frames

    def varied(self, seed: int | None) -> Shape:
        """The shape with limbs that are slightly longer or shorter, thicker or thinner; itself for the seed None."""
        if seed is None:
            return self
        stretch = np.exp(_draw(seed, self.name, 3) * LARGEST_STRETCH)
        moved: dict[str, Array] = {}
        limbs: list[Limb] = []
        for limb in self.limbs:
            points = np.array(limb.points, dtype=float)
            longer, thicker = np.exp(_draw(seed, f"{self.name} {_side_free(limb.name)}", 2) * LARGEST_VARIATION)
            if not limb.varied or (isinstance(limb, Plate) and limb.joints) or isinstance(limb, Lathe):
                longer = thicker = 1.0
            origin = points[0]
            start = origin * stretch
            if limb.joint is not None:
                before = np.array(next(each for each in self.limbs if each.name == limb.joint[0]).points[limb.joint[1]])
                start = moved[limb.joint[0]][limb.joint[1]] + (origin - before) * stretch
            new = start + (points - origin) * stretch * longer
            moved[limb.name] = new
            limbs.append(
                replace(
                    limb,
                    points=[(x, y, z) for x, y, z in new.tolist()],
                    radii=[radius * float(thicker) for radius in limb.radii],
                )
            )
        return replace(self, limbs=limbs)


def mirrored(limb: Limb) -> Limb:
    """The right counterpart of a left limb."""

    def other(text: str) -> str:
        return text.replace("left", "right")

    def other_joint(joint: Joint) -> Joint:
        return other(joint[0]), joint[1]

    changes: dict[str, object] = {
        "name": other(limb.name),
        "points": [(-x, y, z) for x, y, z in limb.points],
        "joint": limb.joint and other_joint(limb.joint),
    }
    if isinstance(limb, Tube | Plate):
        changes["parts"] = other(limb.parts) if isinstance(limb.parts, str) else [other(part) for part in limb.parts]
    if isinstance(limb, Plate):
        changes["joints"] = [other_joint(joint) for joint in limb.joints]
    return replace(limb, **changes)  # type: ignore[arg-type]


def about(start: Triple, end: Triple, angle: float) -> Triple:
    """The rotation vector of a turn by an angle in degrees about the line from one point to another."""
    along = np.array(end) - np.array(start)
    x, y, z = (angle / np.sqrt((along**2).sum()) * along).tolist()
    return x, y, z


def _draw(seed: int, key: str, count: int) -> Array:
    """Numbers from -1 to 1 that depend on nothing but the seed and the key."""
    return np.random.default_rng([seed, zlib.crc32(key.encode())]).uniform(-1, 1, count)


def _side_free(name: str) -> str:
    """The name that a left and a right limb have in common."""
    return name.replace("left ", "").replace("right ", "")


def _carried(points: Array, bases: Sequence[tuple[Array, Array, Array]]) -> Frames:
    """Points of which each moves with a joint of its own."""
    placed = [after + turn @ (point - before) for point, (before, after, turn) in zip(points, bases, strict=True)]
    return Frames(np.array(placed), np.array([turn for _, _, turn in bases]))


def _refined(points: Array, radii: Array, count: int) -> tuple[Array, Array]:
    """A smooth curve through points, with so many pieces per span, and radii that do not overshoot."""
    if count == 1:
        return points, radii
    spans = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1))
    at = np.concatenate([[0.0], np.cumsum(spans)])
    slopes = np.diff(points, axis=0) / spans[:, None]
    tangents = np.vstack([slopes[:1], slopes[-1:]])
    if len(spans) > 1:
        # The derivative of the parabola through each point and its two neighbours.
        share = (spans[1:] / (spans[:-1] + spans[1:]))[:, None]
        tangents = np.insert(tangents, 1, share * slopes[:-1] + (1 - share) * slopes[1:], axis=0)
    shares = np.arange(count) / count
    where = np.append((at[:-1, None] + spans[:, None] * shares).ravel(), at[-1])
    return CubicHermiteSpline(at, points, tangents)(where), PchipInterpolator(at, radii)(where)


def _turning(before: Array, after: Array) -> Array:
    """The smallest rotations that turn some vectors into the directions of others."""
    a = before / np.sqrt((before**2).sum(axis=1))[:, None]
    b = after / np.sqrt((after**2).sum(axis=1))[:, None]
    axis, cosine = np.cross(a, b), (a * b).sum(axis=1)
    cross = np.zeros((len(a), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]] = axis
    cross[:, [1, 2, 0], [2, 0, 1]] = -axis
    return np.eye(3) + cross + np.einsum("pij,pjk->pik", cross, cross) / (1 + cosine)[:, None, None]


def _triangle_frames(corners: Array) -> Array:
    """An orthonormal frame of each triangle, as columns."""
    x = corners[:, 1] - corners[:, 0]
    x = x / np.sqrt((x**2).sum(axis=1))[:, None]
    z = np.cross(x, corners[:, 2] - corners[:, 0])
    z = z / np.sqrt((z**2).sum(axis=1))[:, None]
    return np.stack([x, np.cross(z, x), z], axis=2)
