"""What in a robot is allowed but hardly meant: degrees read as radians, a joint that another drive moves."""

from collections.abc import Iterator

import numpy as np

from beamstiff.errors import listed
from beamstiff.robot.closure import assembly_doubts, close_loops, near_fold
from beamstiff.robot.coupling import frame_expressions, variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture, sampled_postures

FOLDS = 200  # postures that are looked at
MOST_TURNS = 10  # each way, that a joint without a mistake may have as its limit
FARTHEST = 200.0  # m, that a slide may have
UNEVEN = 0.01  # of a link's length over the postures: calibrated axes stand off their links by less
SOFTEST, STIFFEST = 1e7, 2e12  # Pa, of what machines are built of: from rubber to diamond


def robot_doubts(robot: Robot) -> tuple[str, ...]:
    """Return, one sentence each, what in a robot looks like a mistake; mostly nothing, and no error."""
    of_loops = (*assembly_doubts(compile_kinematics(robot)), *_of_folds(robot)) if robot.loops else ()
    return (
        *_of_limits(robot),
        *_of_joints(robot),
        *_of_materials(robot),
        *(of_loops if robot.loops else _of_lengths(robot)),
    )


def _of_limits(robot: Robot) -> Iterator[str]:
    for variable in robot.variables:
        if variable.limits is None:
            continue
        low, high = variable.limits
        far = max(abs(low), abs(high))
        head = f"robot {robot.name!r}: limits of {variable.name}: {low:g} to {high:g}"
        if variable.kind == "length" and far > FARTHEST:
            yield f"{head} m; a number without a unit is in m, write for instance '{high:g} mm'"
        elif variable.kind != "length" and far > MOST_TURNS * 2 * np.pi:
            turns = (high - low) / (2 * np.pi)
            yield (
                f"{head} rad are {turns:.0f} turns; a number without a unit is in rad, write for instance "
                f"'{high:g} deg'"
            )


def _of_folds(robot: Robot) -> Iterator[str]:
    """Yield that the limits hold postures where loops fold, and one of these."""
    kinematics, q = compile_kinematics(robot), sampled_postures(robot, FOLDS, 0)
    values, closed, _ = close_loops(kinematics, q, strict=False)
    folded = near_fold(kinematics, values[closed])
    if folded.any():
        kinds = variable_kinds(robot)
        at = zip((one.name for one in robot.actuated), q[closed][folded][0].tolist(), strict=True)
        place = listed(
            f"{name} = {value * 1e3:.4g} mm"
            if kinds[name] == "length"
            else f"{name} = {np.degrees(value):.4g} deg"
            for name, value in at
        )
        yield (
            f"robot {robot.name!r}: within the limits its loops come near a fold, such as at {place}: beyond "
            "it they may close in another assembly. Narrow the limits"
        )


def _of_lengths(robot: Robot) -> Iterator[str]:
    """Yield links that become longer or shorter as joints turn: they hold what is to move."""
    if not robot.actuated:
        return
    kinds = variable_kinds(robot)
    q = sampled_postures(robot, 3, 0)
    slides = [at for at, one in enumerate(robot.actuated) if kinds[one.name] == "length"]
    q[:, slides] = q[0, slides]  # a link may end where a guide holds
    with np.errstate(over="ignore", invalid="ignore"):
        at = posture(compile_kinematics(robot), q).node_positions
    if not np.abs(at).max() < 1.0 / np.finfo(float).eps:
        return  # lengths that nothing is built of: elsewhere refused
    index = {node.name: number for number, node in enumerate(robot.nodes)}
    for kind, links in (("rigid", robot.rigids), ("beam", robot.beams)):
        for link in links:
            first, second = (index[name] for name in link.nodes)
            length = np.linalg.norm(at[:, first] - at[:, second], axis=1)
            if np.ptp(length) > UNEVEN * length.max():
                yield (
                    f"robot {robot.name!r}: the {kind} {link.name!r} would be {1e3 * length.min():.4g} to "
                    f"{1e3 * length.max():.4g} mm long as joints turn: it holds {link.nodes[0]!r} and "
                    f"{link.nodes[1]!r} together, which these move apart"
                )


def _of_materials(robot: Robot) -> Iterator[str]:
    for name, material in robot.materials.items():
        for modulus, value in (("E", material.E), ("G", material.G)):
            if not SOFTEST <= value <= STIFFEST:
                yield (
                    f"robot {robot.name!r}: material {name}: {modulus} is {value:g} Pa; a number without a "
                    "unit is in Pa, write for instance '210 GPa'"
                )


def _of_joints(robot: Robot) -> Iterator[str]:
    """Yield joints whose variable moves neither what they join nor what hangs on that."""
    moved = {
        name: {variable for one in parts.values() for variable in one.coefficients}
        for name, parts in frame_expressions(robot).items()
    }
    parents = {frame.name: frame.parent for frame in robot.frames}
    frames = {node.name: node.frame for node in robot.nodes}
    neighbours: dict[str, list[str]] = {}
    for a, b in [*(item.nodes for item in robot.beams), *(item.nodes for item in robot.rigids)]:
        for one, other in ((a, b), (b, a)):
            neighbours.setdefault(one, []).append(other)

    def chain(frame: str) -> set[str]:
        names = set()
        while frame in parents:
            names.add(frame)
            frame = parents[frame]
        return names

    def between(one: str, other: str) -> set[str]:
        """Return the variables that move one node against another."""
        way = chain(frames[one]) ^ chain(frames[other])
        return {variable for frame in way for variable in moved[frame]}

    for joint in robot.joints:
        if joint.variable is None:
            continue
        across = between(*joint.nodes)
        known = across | moved.get(joint.frame, set())
        for node in joint.nodes:  # a slide may move what is held by it, not its own nodes
            for far in neighbours.get(node, []):
                known |= between(node, far)
        if joint.variable in known:
            continue
        found = f", where {listed(sorted(across))} moves" if across else ""
        yield (
            f"robot {robot.name!r}: joint {joint.name!r}: its variable {joint.variable!r} moves nothing "
            f"between {joint.nodes[0]!r} and {joint.nodes[1]!r}{found}: is it another joint's?"
        )
