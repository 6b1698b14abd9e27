"""Start values of joint stiffness, for robots whose file has none."""

from collections.abc import Sequence

from beamstiff.errors import BeamstiffError, OptionError, listed, shown, suggest
from beamstiff.robot.coupling import variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.graph import carrying_parts
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.units import quantity


def with_joint_stiffness(robot: Robot, texts: Sequence[str]) -> Robot:
    """Return the robot with a stiffness about or along the axis of joints that are rigid there.

    They are start values: among what is fitted (`identify`), and marked as guesses (`unmeasured`). `texts`:
    each for all joints, such as ``"1e6 N*m/rad"``, or for one, whose value it replaces: ``"J2=2e6 N*m/rad"``.
    All but those that follow another joint and do not carry the TCP, such as a finger's or a balancer's.
    """
    if not texts:
        return robot
    kinds = variable_kinds(robot)
    own = {
        joint.name: "axial" if kinds[joint.variable] == "length" else "torsional"
        for joint in robot.joints
        if joint.variable is not None
    }
    given: dict[str, float] = {}
    idle = _idle(robot)
    for text in sorted(texts, key=lambda text: "=" in text):  # a joint's own value, wherever it stands, wins
        name, named, value = text.rpartition("=")
        name = name.strip()
        if named and name not in own:
            hint = f"{suggest(name, own)}, expected one of {listed(own, 12)}"
            raise OptionError("joint_stiffness", f"there is no moving joint {name!r}{hint}")
        found: dict[str, float] = {}
        problems: dict[str, BeamstiffError] = {}
        for direction, kind in (("torsional", "rotational stiffness"), ("axial", "translational stiffness")):
            try:
                found[direction] = quantity(value, kind)
            except BeamstiffError as error:
                problems[direction] = error
        if len(found) != 1:  # a plain number fits both
            meant = own.get(name, "torsional" if "torsional" in own.values() else "axial")
            why = f": {problems[meant]}" if not found else ""
            expected = f"expected a stiffness with its unit, such as '1e6 N*m/rad' or '1e8 N/m'{why}"
            raise OptionError("joint_stiffness", f"found {shown(text)}, {expected}")
        ((direction, size),) = found.items()
        every = [joint for joint, kind in own.items() if kind == direction and joint not in idle]
        fitting = [name] if named else every
        if not fitting or own[fitting[0]] != direction:
            why = f"which is {direction}; no joint {'of this name ' if named else ''}moves so"
            raise OptionError("joint_stiffness", f"found {shown(text)}, {why}")
        parameters = [f"{joint}.{direction}" for joint in fitting]
        given |= {one: size for one in parameters if named or robot.parameter(one) == float("inf")}
    wanted = {*robot.identify, *given}
    ordered = [name for name in stiffness_parameters(robot) if name in wanted]
    started = robot.with_parameters(given).model_copy(update={"identify": tuple(ordered)})
    return started.with_unmeasured((), given)


def _idle(robot: Robot) -> set[str]:
    """Return the joints that follow another one and do not lie between the support and the TCP."""
    followers = {variable.name for variable in robot.variables if variable.equals is not None}
    carrying = carrying_parts(robot)
    return {joint.name for joint in robot.joints if joint.variable in followers} - carrying
