"""Random structures whose parts are unlike by many powers of ten, and how right their compliance is."""

import itertools

import numpy as np

from beamstiff import BeamstiffError, Material, compile_structure
from beamstiff.fem.condensation import tcp_compliance
from tests.fem.builders import FREE, RIGID, Array, at_rest, some_rotation
from tests.fem.exact_frame import exact_compliance
from tests.fem.random_frames import RandomFrame, machine_frame

RIGHT = 1e-6  # relative error of an answer that counts as right


def chain(seed: int, powers: float, parts: int = 6) -> RandomFrame:
    """Return beams, rigids and joints in a row, the tool at the end, unlike by so many powers of ten."""
    made = RandomFrame(np.random.default_rng(seed))
    more = made.rng.choice(["beam", "joint", "rigid"], parts - 3)
    for kind in made.rng.permutation(["beam", "beam", "joint", *more]):
        last = len(made.points) - 1
        if kind == "joint":
            made.joint(last, made.node(made.points[last].copy()), rigid=0.2, free=0.0)
        else:
            new = made.node()
            made.beam(last, new) if kind == "beam" else made.rigids.append(made.pair(last, new))
    return _unlike(made, powers)


def with_loops(seed: int, powers: float) -> RandomFrame:
    """Return a structure of all kinds of parts with loops, likewise."""
    for number in itertools.count():
        drawn = int(np.random.default_rng((seed, number)).integers(2**32))
        made = machine_frame(drawn, loops=3, rigid=0.2, free=0.0, rigid_loops=bool(seed % 2))
        if len(made.beams) + len(made.joints) + len(made.struts) > 2:
            return _unlike(made, powers)
    raise AssertionError


def _unlike(made: RandomFrame, powers: float) -> RandomFrame:
    """Multiply the stiffness of all parts, of the softest and the stiffest by so many powers of ten apart."""
    count = len(made.beams) + len(made.joints) + len(made.struts)
    exponents = powers * made.rng.random(count)
    exponents[made.rng.choice(count, 2, replace=False)] = 0.0, powers
    factors = iter(10.0 ** (exponents - powers / 2))
    made.materials = [
        Material(E=one.E * factor, G=one.G * factor, density=one.density)
        for one, factor in zip(made.materials, factors, strict=False)
    ]
    made.joints = [(i, j, axis, kinds * next(factors)) for i, j, axis, kinds in made.joints]
    made.struts = [(i, j, value * next(factors)) for i, j, value in made.struts]
    return made


def stretched_tie(gap: float, seed: int | None = None) -> RandomFrame:
    """Return two links with a free elbow, a tie from base to tip: stretched but for a gap at the elbow."""
    made = RandomFrame(np.random.default_rng(seed))
    turn = np.eye(3) if seed is None else some_rotation(seed)
    shift = np.zeros(3) if seed is None else made.rng.uniform(-1, 1, 3)
    points = (
        np.array([(0, 0, 0), (0, 0, 0), (1, 0, 0), (1, 0, 0), (1.7, gap, 0)], dtype=float) @ turn.T + shift
    )
    made.points = list(points)
    made.rigids = [(1, 2), (3, 4)]
    hinge = np.array([RIGID, RIGID, FREE, RIGID])
    made.joints = [(0, 1, turn[:, 2], np.array([RIGID, RIGID, 1e5, RIGID])), (2, 3, turn[:, 2], hinge)]
    made.struts = [(0, 4, 3e6)]
    return made


def outcome(made: RandomFrame) -> tuple[str, str]:
    """Return what becomes of a structure, and what is said where it is refused.

    It is "right", "wrong", "refused" though there is an answer, or "mechanism" where there is none.
    """
    robot = made.robot()
    exact = exact_compliance(made.reference(), int(robot.tcp[1:]))
    structure = compile_structure(robot)
    try:
        found = tcp_compliance(structure, at_rest(structure))[0]
    except BeamstiffError as refused:
        return "mechanism" if exact is None else "refused", str(refused)
    right = exact is not None and relative_error(found, exact) <= RIGHT
    return "right" if right else "wrong", ""


def relative_error(found: Array, exact: Array) -> float:
    """Return the largest error of a compliance, of each entry by the works of its two loads themselves."""
    size = np.sqrt(np.diagonal(exact))
    scale = np.outer(size, size)
    return float((np.abs(found - exact) / np.where(scale > 0.0, scale, np.inf)).max())
