"""Small machines for the tests of the kinematics, and what their papers and textbooks say of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff import Frame, Loop, Node, Rigid, Robot, Variable
from tests.robots.slider_cranks import arctangent, marie_theta

Array = NDArray[np.float64]

# IR-663 (Marie, Courteille, Maurine, table 2), m
HEIGHT, D3, D9, D10, D11, REACH = 0.885, 1.047, 0.473, 0.400, 1.212, 1.760
# ball screw of our own: crank radius, distance of the axes, rad
L12, L32, LAMBDA2, KAPPA2 = 0.35, 0.9, 0.4, 0.7


def machine(
    variables: Sequence[Variable],
    frames: Sequence[Frame],
    tool: tuple[str, Sequence[float]],
    loops: Sequence[Loop] = (),
    nodes: Sequence[Node] = (),
) -> Robot:
    """Return a robot of frames alone: one rigid holds its nodes together."""
    return Robot(
        name="machine",
        variables=tuple(variables),
        frames=tuple(frames),
        loops=tuple(loops),
        nodes=(Node(name="foot"), Node(name="tool", frame=tool[0], at=tuple(tool[1])), *nodes),
        rigids=tuple(
            Rigid(name=f"r{at}", nodes=("foot", name))
            for at, name in enumerate(["tool", *(node.name for node in nodes)])
        ),
        fixed=("foot",),
        tcp="tool",
    )


def revolute(name: str, **more: Any) -> Variable:
    """Return a revolute variable."""
    return Variable(name=name, type="revolute", **more)


def prismatic(name: str, **more: Any) -> Variable:
    """Return a prismatic variable."""
    return Variable(name=name, type="prismatic", **more)


# KR240-2: Dumas et al., table 3, lengths in m as SEEDS.md found them
D2, D3_KR, D4, RL4, RL6 = 0.350, 1.250, -0.055, 1.100, 0.230


def kr240(limits: tuple[float, float] | None = None) -> Robot:
    """Return the KUKA KR240-2 of Dumas et al., table 3."""
    half = np.pi / 2
    rows = [(0, 0, 0), (half, D2, 0), (0, D3_KR, 0), (-half, D4, RL4), (half, 0, 0), (-half, 0, RL6)]
    return machine(
        [revolute(f"q{at}", limits=limits) for at in range(1, 7)],
        [
            Frame(
                name=f"f{at}",
                parent=f"f{at - 1}" if at > 1 else "base",
                alpha=alpha,
                d=d,
                theta=f"q{at}",
                r=r,
            )
            for at, (alpha, d, r) in enumerate(rows, start=1)
        ],
        tool=("f6", (0, 0, 0)),
    )


def kr240_appendix_a(q: Array) -> Array:
    """Return the Jacobian (P, 6, 6) as printed in Dumas et al., Appendix A, its rows set apart again."""
    s1, s4, s5 = (np.sin(q[:, at]) for at in (0, 3, 4))
    c1, c4, c5 = (np.cos(q[:, at]) for at in (0, 3, 4))
    s2, c2, s23, c23 = np.sin(q[:, 1]), np.cos(q[:, 1]), np.sin(q[:, 1] + q[:, 2]), np.cos(q[:, 1] + q[:, 2])
    zero, one = np.zeros(len(q)), np.ones(len(q))
    d2, d3, d4 = D2, D3_KR, D4
    rows = [
        [
            -d2 * s1 - d3 * c2 * s1 - d4 * c23 * s1 + RL4 * s1 * s23 + RL6 * c5 * s1 * s23
            + RL6 * c23 * c4 * s1 * s5 + RL6 * c1 * s4 * s5,
            -RL4 * c1 * c23 - RL6 * c1 * c23 * c5 - d3 * c1 * s2 - d4 * c1 * s23 + RL6 * c1 * c4 * s23 * s5,
            -RL4 * c1 * c23 - RL6 * c1 * c23 * c5 - d4 * c1 * s23 + RL6 * c1 * c4 * s23 * s5,
            RL6 * c4 * s1 * s5 + RL6 * c1 * c23 * s4 * s5,
            -RL6 * c1 * c23 * c4 * c5 + RL6 * c5 * s1 * s4 + RL6 * c1 * s23 * s5,
            zero,
        ],
        [
            d2 * c1 + d3 * c1 * c2 + d4 * c1 * c23 - RL4 * c1 * s23 - RL6 * c1 * c5 * s23
            - RL6 * c1 * c23 * c4 * s5 + RL6 * s1 * s4 * s5,
            -RL4 * c23 * s1 - RL6 * c23 * c5 * s1 - d3 * s1 * s2 - d4 * s1 * s23 + RL6 * c4 * s1 * s23 * s5,
            -RL4 * c23 * s1 - RL6 * c23 * c5 * s1 - d4 * s1 * s23 + RL6 * c4 * s1 * s23 * s5,
            -RL6 * c1 * c4 * s5 + RL6 * c23 * s1 * s4 * s5,
            -RL6 * c23 * c4 * c5 * s1 - RL6 * c1 * c5 * s4 + RL6 * s1 * s23 * s5,
            zero,
        ],
        [
            zero,
            d3 * c2 + d4 * c23 - RL4 * s23 - RL6 * c5 * s23 - RL6 * c23 * c4 * s5,
            d4 * c23 - RL4 * s23 - RL6 * c5 * s23 - RL6 * c23 * c4 * s5,
            RL6 * s23 * s4 * s5,
            -RL6 * c4 * c5 * s23 - RL6 * c23 * s5,
            zero,
        ],
        [zero, s1, s1, -c1 * s23, c4 * s1 + c1 * c23 * s4,
            -c1 * c5 * s23 - c1 * c23 * c4 * s5 + s1 * s4 * s5],
        [zero, -c1, -c1, -s1 * s23, -c1 * c4 + c23 * s1 * s4,
            -c5 * s1 * s23 - c23 * c4 * s1 * s5 - c1 * s4 * s5],
        [one, zero, zero, c23, s23 * s4, c23 * c5 - c4 * s23 * s5],
    ]  # fmt: skip
    return np.moveaxis(np.array(rows), -1, 0)


def coupled_arm() -> Robot:
    """Return an arm with coupled wrist axes (biconic, as the IR-663), a rack and a skewed base."""
    return machine(
        [
            revolute("q1"),
            revolute("q2"),
            revolute("q5"),
            prismatic("lift"),
            Variable(name="th6", equals="-q5"),
            prismatic("rack", equals="120 mm/rad * q2 + 2*lift"),
        ],
        [
            Frame(name="f1", gamma="10 deg", b="0.2 m", theta="q1 + 5 deg", r="lift + 0.3"),
            Frame(name="f2", parent="f1", alpha="-90 deg", d="0.4 m", theta="q2 - q5", beta="3 deg"),
            Frame(name="f5", parent="f2", alpha="30 deg", b="rack", theta="q5"),
            Frame(
                name="f6", parent="f5", gamma="0.5*q1", alpha="-60 deg", d="rack", theta="th6", beta="0.25*q2"
            ),
        ],
        tool=("f6", (0.1, -0.2, 0.3)),
    )


def ir663(
    a: str = "f10", b: str = "f11", constrain: str = "position", lever: float = D10, **guess: float
) -> Robot:
    """Return the four-bar of the IR-663 on its axis 1; the lever d10 lies along y of frame 3."""
    guesses = {"th3": np.radians(26), "th9": np.radians(-137), **guess}
    return machine(
        [
            revolute("q1"),
            revolute("q2", limits=("-40 deg", "50 deg")),
            revolute("q8", limits=("20 deg", "75 deg")),
            *(revolute(name, passive=True, guess=value) for name, value in guesses.items()),
        ],
        [
            Frame(name="f1", theta="q1", r=HEIGHT),
            Frame(name="f2", parent="f1", alpha="-90 deg", theta="q2 - 90 deg"),
            Frame(name="f3", parent="f2", d=D3, theta="th3"),
            Frame(name="f8", parent="f1", alpha="-90 deg", theta="q8"),
            Frame(name="f9", parent="f8", d=D9, theta="th9"),
            Frame(name="f10", parent="f3", gamma="90 deg", d=lever, theta="th10" if "th10" in guess else 0.0),
            Frame(name="f11", parent="f9", d=D11),
        ],
        tool=("f3", (0, REACH, 0)),
        loops=[Loop(name="four_bar", a=a, b=b, constrain=constrain)],
        nodes=[Node(name="p10", frame="f10"), Node(name="p11", frame="f11")],
    )


def four_bar_points(q2: Array, q8: Array) -> tuple[Array, Array]:
    """Return P3 and P9 (P, 2) in the vertical plane, from axis 2 (SEEDS.md 003.1)."""
    return D3 * np.stack([np.sin(q2), np.cos(q2)], 1), D9 * np.stack([np.cos(q8), -np.sin(q8)], 1)


def four_bar_th3(q2: Array, q8: Array, branch: int, lever: float = D10) -> Array:
    """Return theta3 along the lever d10 (Marie et al., A.1, A.2, the two signs set right)."""
    z2, w = -lever, -D11
    x, y = D9 * np.cos(q2 - q8), D3 - D9 * np.sin(q2 - q8)
    return arctangent(2 * z2 * x, -2 * z2 * y, w**2 - x**2 - y**2 - z2**2, branch)


def four_bar(
    crank: float,
    rocker: float,
    guess: Sequence[float],
    coupler: float = 1.0,
    ground: float = 1.0,
    plane: Frame | None = None,
) -> Robot:
    """Return a four-bar, in the plane of the base or of a frame, with the guess of its two passive angles."""
    parent = "base" if plane is None else plane.name
    return machine(
        [
            revolute("q"),
            *(revolute(name, passive=True, guess=at) for name, at in zip("pr", guess, strict=True)),
        ],
        [
            *([plane] if plane else []),
            Frame(name="crank", parent=parent, theta="q"),
            Frame(name="coupler", parent="crank", d=crank, theta="p"),
            Frame(name="rocker", parent=parent, d=ground, theta="r"),
        ],
        tool=("coupler", (coupler, 0, 0)),
        loops=[Loop(name="four_bar", a="tool", b="end", constrain="position")],
        nodes=[Node(name="end", frame="rocker", at=(rocker, 0, 0))],
    )


def slider_crank(phi: float = 3.0, psi: float = -2.7) -> Robot:
    """Return a ball screw of length `screw` that drives theta2 of a crank (Marie et al., figure A.19).

    The crank's end is at L12 from the axis, the screw's pivot at L32; theta2 = kappa2 - phi + pi/2.
    """
    return machine(
        [
            prismatic("screw", limits=(0.6, 1.2)),
            revolute("phi", passive=True, guess=phi),
            revolute("psi", passive=True, guess=psi),
            Variable(name="theta2", equals=f"{KAPPA2 + np.pi / 2!r} - phi"),
        ],
        [
            Frame(name="crank", theta="phi"),
            # the pivot lies at -(xB, yB) from the axis
            Frame(name="pivot", gamma=float(np.pi + np.pi / 2 - LAMBDA2), d=L32, theta="psi"),
            Frame(name="nut", parent="pivot", d="screw"),
            Frame(name="arm", theta="theta2"),
        ],
        tool=("arm", (0.8, 0, 0)),
        loops=[Loop(name="slider_crank", a="end", b="nut", constrain="position")],
        nodes=[Node(name="end", frame="crank", at=(L12, 0, 0))],
    )


def slider_crank_theta2(screw: Array, branch: int) -> Array:
    """Return theta2 (Marie et al., A.3)."""
    return marie_theta(screw, KAPPA2, LAMBDA2, L12, L32, branch)


BENNETT = (
    0.6,
    np.radians(40.0),
    np.radians(100.0),
)  # a, alpha, beta; b follows from a / sin alpha = b / sin beta


def bennett(guess: Sequence[float]) -> Robot:
    """Return Bennett's linkage: four hinges that only move because their proportions are right."""
    a, alpha, beta = BENNETT
    b = a * np.sin(beta) / np.sin(alpha)
    return machine(
        [
            revolute("q1"),
            *(revolute(f"t{at}", passive=True, guess=value) for at, value in enumerate(guess, 2)),
        ],
        [
            Frame(name="f1", theta="q1"),
            Frame(name="f2", parent="f1", alpha=float(alpha), d=a, theta="t2"),
            Frame(name="f3", parent="f2", alpha=float(beta), d=float(b), theta="t3"),
            Frame(name="f4", parent="f3", alpha=float(alpha), d=a, theta="t4"),
            Frame(name="f5", parent="f4", alpha=float(beta), d=float(b)),
        ],
        tool=("f2", (0.5, 0.1, 0.2)),
        loops=[Loop(name="bennett", a="base", b="f5", constrain="pose")],
    )


def screw_driven_ir663() -> Robot:
    """Return the four-bar of `ir663` with a ball screw each for q2 and q8: three loops that share frames."""
    return machine(
        [
            prismatic("r2", limits=(0.7, 1.1)),
            prismatic("r8", limits=(0.75, 0.95)),
            revolute("q2", passive=True, guess=0.1),
            revolute("q8", passive=True, guess=0.8),
            revolute("th3", passive=True, guess=np.radians(26)),
            revolute("th9", passive=True, guess=np.radians(-137)),
            revolute("s2", passive=True, guess=0.2),
            revolute("s8", passive=True, guess=0.2),
        ],
        [
            Frame(name="f1", r=HEIGHT),
            Frame(name="f2", parent="f1", alpha="-90 deg", theta="q2 - 90 deg"),
            Frame(name="f3", parent="f2", d=D3, theta="th3"),
            Frame(name="f8", parent="f1", alpha="-90 deg", theta="q8"),
            Frame(name="f9", parent="f8", d=D9, theta="th9"),
            Frame(name="f10", parent="f3", gamma="90 deg", d=D10),
            Frame(name="f11", parent="f9", d=D11),
            Frame(name="pivot2", parent="f1", gamma=0.0, alpha="-90 deg", d=-0.8, theta="s2"),
            Frame(name="nut2", parent="pivot2", d="r2"),
            Frame(name="pivot8", parent="f1", gamma=0.0, alpha="-90 deg", d=-0.7, theta="s8"),
            Frame(name="nut8", parent="pivot8", d="r8"),
        ],
        tool=("f3", (0, REACH, 0)),
        loops=[
            Loop(name="screw2", a="e2", b="nut2", constrain="position"),
            Loop(name="four_bar", a="f10", b="f11", constrain="position"),
            Loop(name="screw8", a="e8", b="nut8", constrain="plane"),
        ],
        nodes=[Node(name="e2", frame="f2", at=(0.4, 0, 0)), Node(name="e8", frame="f8", at=(0.3, 0, 0))],
    )


def telescope() -> Robot:
    """Return a hand moved in polar coordinates, followed by a passive slide on a post beside it."""
    return machine(
        [
            revolute("q1"),
            prismatic("reach"),
            revolute("bearing", passive=True),
            prismatic("slide", passive=True, guess=1.0),
        ],
        [
            Frame(name="arm", theta="q1"),
            Frame(name="hand", parent="arm", d="reach + 2"),
            Frame(name="post", d=0.7, theta="bearing"),
            Frame(name="nut", parent="post", d="slide"),
        ],
        tool=("hand", (0, 0, 0)),
        loops=[Loop(name="telescope", a="hand", b="nut", constrain="plane")],
    )
