"""Closed machines drawn at random, with closed forms of where their tools stand.

Each is drawn from a posture that is known to be closed: lengths that close it follow from it, so that the
truth needs no solver. Four-bars, slider-cranks and six-bars of two dyads are circles that cut; the legs of a
platform have their lengths from its pose.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Frame, Loop, Node, Rigid, Variable

Array = NDArray[np.float64]
MORE = 10  # postures of the same assembly


@dataclass(frozen=True)
class Machine:
    """A closed machine with what is known of it.

    Attributes
    ----------
    robot : Robot
        Its guesses off.
    q : (P, A) array
        Actuated variables, the posture that the guesses were taken from first.
    tool : (P, 3) array
        Where the tool stands.
    """

    robot: Robot
    q: Array
    tool: Array


# how far postures (P,) are from a dead centre, (P,): sine of the angle at which links meet; 0: none closes
Toggle = Callable[[Array], Array]
Walk = Callable[
    [np.random.Generator, Toggle], Array | None
]  # draws postures, the first of them for the guesses


def _robot(
    variables: list[Variable], frames: list[Frame], loops: list[Loop], tool: str, nodes: list[Node]
) -> Robot:
    return Robot(
        name="drawn",
        variables=tuple(variables),
        frames=tuple(frames),
        loops=tuple(loops),
        nodes=(Node(name="foot"), Node(name="tool", frame=tool, at=(0.1, 0.05, 0.0)), *nodes),
        rigids=tuple(
            Rigid(name=f"r_{name}", nodes=("foot", name)) for name in ["tool", *(node.name for node in nodes)]
        ),
        fixed=("foot",),
        tcp="tool",
    )


def _passive(rng: np.random.Generator, off: float, **values: float) -> list[Variable]:
    """Return passive angles whose guesses are off."""
    return [
        Variable(name=name, type="revolute", passive=True, guess=value + off * rng.uniform(-1, 1))
        for name, value in values.items()
    ]


def _unit(angle: Array | float) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _angle(vector: Array) -> Array:
    return np.asarray(np.arctan2(vector[..., 1], vector[..., 0]))


def _apex(a: Array, b: Array, la: float, lb: float, side: int) -> Array:
    """Return the point at la from a and lb from b, left (1) or right (-1) of the way to b; NaN: none."""
    way = b - a
    length = np.linalg.norm(way, axis=-1)
    along = (la**2 - lb**2 + length**2) / (2 * length)
    with np.errstate(invalid="ignore"):
        across = side * np.sqrt(la**2 - along**2)
    unit = way / length[..., None]
    normal = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
    return np.asarray(a + along[..., None] * unit + across[..., None] * normal)


def _tool(origin: Array, angle: Array) -> Array:
    x, y = _unit(angle), _unit(angle + np.pi / 2)
    return np.concatenate([origin + 0.1 * x + 0.05 * y, np.zeros((len(origin), 1))], axis=1)


def _limits(rng: np.random.Generator, q: Array) -> tuple[float, float] | None:
    """Return limits around the postures for every second machine."""
    return (float(q.min()) - 0.02, float(q.max()) + 0.02) if rng.random() < 0.5 else None


def reachable(rng: np.random.Generator, toggle: Toggle) -> Array | None:
    """Return crank angles of one range that closes: a first one and `MORE` about it; None: there is none."""
    first = rng.uniform(-np.pi, np.pi)
    around = first + np.linspace(-0.6, 0.6, 121)
    good = toggle(around) > 0.1
    if not good[60]:
        return None
    low = 60 - int(np.argmin(np.append(good[60::-1], False)))
    high = 60 + int(np.argmin(np.append(good[60:], False)))
    if high - low < 20:
        return None
    return np.concatenate([[first], rng.uniform(around[low + 1], around[high - 1], MORE)])


def four_bar(
    rng: np.random.Generator, off: float, walk: Walk = reachable, parallel: bool = False
) -> Machine | None:
    """Return a four-bar with its tool on the coupler, or a parallelogram, away from its dead centres."""
    ground, crank = rng.uniform(0.5, 1.5), rng.uniform(0.3, 1.0)
    coupler, rocker = (ground, crank) if parallel else (rng.uniform(0.4, 1.5), rng.uniform(0.4, 1.2))
    side = int(rng.choice([-1, 1]))
    far = np.array([ground, 0.0])

    def apex(q: Array, at: int) -> Array:
        return _apex(crank * _unit(q), np.broadcast_to(far, (len(q), 2)), coupler, rocker, at)

    def toggle(q: Array) -> Array:
        b, a = apex(q, side), crank * _unit(q)
        return np.nan_to_num(np.abs(np.sin(_angle(b - a) - _angle(b - far))))

    q = walk(rng, toggle)
    if q is None:
        return None
    if parallel:  # the parallelogram itself, not the crossed one
        side = 1 if abs(_angle(apex(q[:1], 1) - crank * _unit(q[:1]))[0]) < 1e-6 else -1
    top = apex(q, side)
    turn, rock = _angle(top - crank * _unit(q)), _angle(top - far)
    robot = _robot(
        [
            Variable(name="q", type="revolute", limits=_limits(rng, q)),
            *_passive(rng, off, p=float(turn[0] - q[0]), r=float(rock[0])),
        ],
        [
            Frame(name="f1", theta="q"),
            Frame(name="f2", parent="f1", d=crank, theta="p"),
            Frame(name="e2", parent="f2", d=coupler),
            Frame(name="f3", d=ground, theta="r"),
            Frame(name="e3", parent="f3", d=rocker),
        ],
        [Loop(name="four_bar", a="e2", b="e3", constrain="position" if rng.random() < 0.5 else "plane")],
        "f2",
        [Node(name="n3", frame="e3")],
    )
    return Machine(robot, q[:, None], _tool(crank * _unit(q), turn))


def slider_crank(rng: np.random.Generator, off: float, walk: Walk | None = None) -> Machine | None:
    """Return a crank driven by a screw between it and a pivot; the tool on the crank."""
    crank, ground = rng.uniform(0.3, 0.8), rng.uniform(0.6, 1.3)
    side = int(rng.choice([-1, 1]))
    pivot = np.array([ground, 0.0])

    def toggle(inner: Array) -> Array:
        end = crank * _unit(inner)
        return np.abs(np.sin(inner - _angle(end - pivot)))

    if walk is None:
        inner = side * rng.uniform(0.3, np.pi - 0.3, MORE + 1)  # of the crank, away from dead centres
    elif (found := walk(rng, toggle)) is None:
        return None
    else:
        inner = found
    end = crank * _unit(inner)
    length, turn = np.linalg.norm(end - pivot, axis=1), _angle(end - pivot)
    robot = _robot(
        [
            Variable(name="s", type="prismatic", limits=_limits(rng, length)),
            *_passive(rng, off, crank=float(inner[0]), screw=float(turn[0])),
        ],
        [
            Frame(name="f1", theta="crank"),
            Frame(name="e1", parent="f1", d=crank),
            Frame(name="f2", d=ground, theta="screw"),
            Frame(name="e2", parent="f2", d="s"),
        ],
        [Loop(name="screw", a="e1", b="e2", constrain="position")],
        "f1",
        [Node(name="n2", frame="e2")],
    )
    return Machine(robot, length[:, None], _tool(np.zeros((len(inner), 2)), inner))


def six_bar(rng: np.random.Generator, off: float, walk: Walk = reachable) -> Machine | None:
    """Return a four-bar whose coupler drives a second dyad (Stephenson III); the tool on that dyad."""
    ground, crank, coupler, rocker = rng.uniform([0.5, 0.3, 0.4, 0.4], [1.5, 0.8, 1.5, 1.2])
    link, last = rng.uniform(0.4, 1.2, 2)
    pivot = rng.uniform(-1.2, 1.2, 2)
    arm, bend = rng.uniform(0.2, 0.8), rng.uniform(-1.5, 1.5)
    sides = rng.choice([-1, 1], 2)
    far = np.array([ground, 0.0])

    def points(q: Array) -> tuple[Array, Array, Array, Array]:
        a = crank * _unit(q)
        b = _apex(a, np.broadcast_to(far, a.shape), coupler, rocker, int(sides[0]))
        turn = _angle(b - a)
        c = a + arm * _unit(turn + bend)
        d = _apex(c, np.broadcast_to(pivot, a.shape), link, last, int(sides[1]))
        return a, b, c, d

    def toggle(q: Array) -> Array:
        a, b, c, d = points(q)
        one = np.abs(np.sin(_angle(b - a) - _angle(b - far)))
        other = np.abs(np.sin(_angle(d - c) - _angle(d - pivot)))
        return np.minimum(np.nan_to_num(one), np.nan_to_num(other))

    q = walk(rng, toggle)
    if q is None:
        return None
    a, b, c, d = points(q)
    turn, rock, way, swing = _angle(b - a), _angle(b - far), _angle(d - c), _angle(d - pivot)
    robot = _robot(
        [
            Variable(name="q", type="revolute", limits=_limits(rng, q)),
            *_passive(
                rng,
                off,
                p=float(turn[0] - q[0]),
                r=float(rock[0]),
                w=float(way[0] - turn[0] - bend),
                s=float(swing[0]),
            ),
        ],
        [
            Frame(name="f1", theta="q"),
            Frame(name="f2", parent="f1", d=crank, theta="p"),
            Frame(name="e2", parent="f2", d=coupler),
            Frame(name="f3", d=ground, theta="r"),
            Frame(name="e3", parent="f3", d=rocker),
            Frame(name="b2", parent="f2", gamma=bend),
            Frame(name="f4", parent="b2", d=arm, theta="w"),
            Frame(name="e4", parent="f4", d=link),
            Frame(name="p5", gamma=float(_angle(pivot)), d=0.0),
            Frame(name="b5", parent="p5", d=float(np.linalg.norm(pivot))),
            Frame(name="f5", parent="b5", gamma=-float(_angle(pivot)), theta="s"),
            Frame(name="e5", parent="f5", d=last),
        ],
        [
            Loop(name="first", a="e2", b="e3", constrain="position"),
            Loop(name="second", a="e4", b="e5", constrain="position"),
        ],
        "f4",
        [Node(name="n3", frame="e3"), Node(name="n5", frame="e5")],
    )
    return Machine(robot, q[:, None], _tool(c, way))


def _turned(rng: np.random.Generator, most: float) -> Array:
    """Return a small rotation (3, 3)."""
    axis = rng.standard_normal(3)
    return _rotation(axis / np.linalg.norm(axis), rng.uniform(0, most))


def _rotation(axis: Array, angle: float) -> Array:
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation: Array = np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
    return rotation


def _leg_angles(way: Array) -> tuple[float, float, float]:
    """Return (a, b, length) with ``rot(z, a) rot(x, b) (0, 0, length)`` the way."""
    length = float(np.linalg.norm(way))
    a = float(np.arctan2(way[0], -way[1]))
    b = float(np.arctan2(np.hypot(way[0], way[1]), way[2]))
    return a, b, length


def _turn_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def _turn_x(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


def _dexterity(foot: Array, place: Array, rotation: Array, head: Array) -> float:
    """Return the determinant of the legs' lines at a platform: zero where it can move with all legs held."""
    arm = head @ rotation.T
    way = place + arm - foot
    way /= np.linalg.norm(way, axis=1)[:, None]
    return float(np.linalg.det(np.concatenate([way, np.cross(arm, way) / np.linalg.norm(head[0])], axis=1)))


def stewart(rng: np.random.Generator, off: float, walk: Walk | None = None) -> Machine | None:
    """Return a platform on six legs, the tool on the platform; every leg on a universal joint.

    The legs lean out, so that the two angles of each are determined; the platform hangs on the first leg by
    three turning joints.
    """
    base_at = np.radians([15, 45, 135, 165, 255, 285]) + rng.uniform(-0.1, 0.1, 6)
    top_at = np.radians([-15, 75, 105, 195, 225, 315]) + rng.uniform(-0.1, 0.1, 6)
    foot = rng.uniform(0.7, 1.0) * np.concatenate([_unit(base_at), np.zeros((6, 1))], axis=1)
    head = rng.uniform(0.35, 0.5) * np.concatenate([_unit(top_at), np.zeros((6, 1))], axis=1)
    high = rng.uniform(0.8, 1.2)

    def pose() -> tuple[Array, Array]:
        rotation = _turned(rng, 0.3)
        return np.array([*rng.uniform(-0.15, 0.15, 2), high + rng.uniform(-0.15, 0.15)]), rotation

    poses = [pose() for _ in range(MORE + 1)] if walk is None else _twisted(rng, walk, foot, head, pose())
    if poses is None:
        return None
    places, rotations = zip(*poses, strict=True)
    lengths = [np.linalg.norm(place + head @ rotation.T - foot, axis=1) for place, rotation in poses]
    ways = places[0] + head @ rotations[0].T - foot
    passive: dict[str, float] = {}
    frames: list[Frame] = []
    for leg, way in enumerate(ways):
        a, b, _ = _leg_angles(way)
        passive |= {f"a{leg}": a, f"b{leg}": b}
        at = float(base_at[leg])
        frames += [
            Frame(name=f"o{leg}", gamma=at, d=float(np.linalg.norm(foot[leg]))),
            Frame(name=f"u{leg}", parent=f"o{leg}", gamma=-at, theta=f"a{leg}"),
            Frame(name=f"v{leg}", parent=f"u{leg}", alpha=f"b{leg}", r=f"s{leg}"),
        ]
    # platform on the first leg: rot(z, x0) rot(x, x1) rot(z, x2), with what that has to be now
    leg = _turn_z(passive["a0"]) @ _turn_x(passive["b0"])
    left = leg.T @ rotations[0]
    x1 = float(np.arccos(np.clip(left[2, 2], -1, 1)))
    if np.sin(x1) < 0.1:
        return None
    passive |= {
        "x0": float(np.arctan2(left[0, 2], -left[1, 2])),
        "x1": x1,
        "x2": float(np.arctan2(left[2, 0], left[2, 1])),
    }
    frames += [
        Frame(name="w0", parent="v0", theta="x0"),
        Frame(name="w1", parent="w0", alpha="x1", theta="x2"),
        Frame(name="top", parent="w1", gamma=float(top_at[0]), d=-float(np.linalg.norm(head[0]))),
        Frame(name="platform", parent="top", gamma=-float(top_at[0])),
    ]
    nodes = [Node(name=f"h{leg}", frame="platform", at=tuple(head[leg])) for leg in range(1, 6)]
    limits = np.array(lengths)
    limited = rng.random() < 0.5
    robot = _robot(
        [
            *(
                Variable(
                    name=f"s{leg}",
                    type="prismatic",
                    limits=(float(limits[:, leg].min()) - 0.05, float(limits[:, leg].max()) + 0.05)
                    if limited
                    else None,
                    guess=float(limits[:, leg].mean()),
                )
                for leg in range(6)
            ),
            *_passive(rng, off, **passive),
        ],
        frames,
        [Loop(name=f"leg{leg}", a=f"v{leg}", b=f"h{leg}", constrain="position") for leg in range(1, 6)],
        "platform",
        nodes,
    )
    tool = np.array(
        [place + rotation @ [0.1, 0.05, 0.0] for place, rotation in zip(places, rotations, strict=True)]
    )
    return Machine(robot, limits, tool)


def _twisted(
    rng: np.random.Generator, walk: Walk, foot: Array, head: Array, first: tuple[Array, Array]
) -> list[tuple[Array, Array]] | None:
    """Return poses of a platform on the way of a screw motion through a first one."""
    axis, slide = rng.standard_normal(3) * [0.3, 0.3, 1.0], rng.uniform(-0.2, 0.2, 3)
    axis /= np.linalg.norm(axis)
    most = _dexterity(foot, *first, head)

    def at(way: float) -> tuple[Array, Array]:
        return first[0] + way * slide, _rotation(axis, way) @ first[1]

    def toggle(ways: Array) -> Array:
        found = []
        for place, rotation in map(at, ways.tolist()):
            a, b, _ = _leg_angles(place + rotation @ head[0] - foot[0])
            # the platform's three angles on its first leg meet where the leg stands square on it
            upright = np.linalg.norm(((_turn_z(a) @ _turn_x(b)).T @ rotation)[:2, 2])
            found.append(min(_dexterity(foot, place, rotation, head) / most, 3 * float(upright)))
        return np.maximum(found, 0.0)

    ways = walk(rng, toggle)
    return None if ways is None else [at(way) for way in ways.tolist()]


KINDS: dict[str, Callable[..., Machine | None]] = {
    "four-bar": four_bar,
    "slider-crank": slider_crank,
    "parallelogram": partial(four_bar, parallel=True),
    "six-bar": six_bar,
    "Stewart platform": stewart,
}
