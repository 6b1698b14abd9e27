"""Stiffness and compliance at the TCP in one posture or many, and where the TCP is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.diagnosis.apply import effects_displacement, is_elastic
from beamstiff.errors import BeamstiffError, OptionError
from beamstiff.fem import condensation
from beamstiff.fem.beam_column import coarse_beams
from beamstiff.fem.geometric_stiffness import loaded_compliance, loaded_stiffness
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.functions.checks import effects_text, left_out, six_numbers, start_values
from beamstiff.functions.robots import as_robot
from beamstiff.measure.table import make_measurements
from beamstiff.model.correction import compliance_correction
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import Posture, compile_kinematics, pose_of, posture, reference_posture
from beamstiff.robot.parts import AddedEffect
from beamstiff.robot.plausibility import robot_doubts
from beamstiff.robot.reader import RobotLike
from beamstiff.robot.stiffness_parameters import check_stiffness
from beamstiff.se3 import Array, vector_from_rotation
from beamstiff.shown import Shown

Joints = Mapping[str, ArrayLike] | ArrayLike


@dataclass(frozen=True, eq=False, repr=False)
class TcpStiffness(Shown):
    """Stiffness and compliance at the TCP in one posture, SI, base frame."""

    robot: Robot
    # (6, 6): ``wrench = K displacement``, with the wrench ``[f, m]`` and the displacement ``[d, r]``; no
    # stiffness (None) where the TCP is rigid in some direction
    stiffness: Array | None
    compliance: Array
    # (3,), m and rad: place of the TCP, and the rotation vector of its frame
    tcp: Array
    orientation: Array
    variables: dict[str, float]  # rad or m: all joint variables, passive ones solved
    preload: bool = False  # tangent stiffness of the loaded machine
    # (R, 6): a basis of the wrenches that do not displace the TCP; empty where there are none
    rigid: Array = field(default_factory=lambda: np.zeros((0, 6)))
    singular: str = ""  # why there is no stiffness; empty where there is one
    # (6,): share of each diagonal element of the compliance that start values make, not measured ones
    guessed: Array = field(default_factory=lambda: np.zeros(6))
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, SI."""
        return {
            "stiffness": None if self.stiffness is None else self.stiffness.tolist(),
            "compliance": self.compliance.tolist(),
            "tcp": self.tcp.tolist(),
            "variables": self.variables,
        }


def stiffness(
    robot: RobotLike, q: Joints | None = None, *, preload: bool = False, wrench: ArrayLike | None = None
) -> TcpStiffness:
    """Return the 6 x 6 stiffness and compliance at the TCP in one posture.

    Elastic effects of the robot are included, but for `preload`: with what they do under 1 N and 1 N m.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
    q : mapping of str to float, or (A,) array, rad or m
        Actuated joint variables; those not named are 0, passive ones are solved. Default the reference
        posture: the middle of the limits, or a posture within them that closes the loops.
    preload : bool
        Tangent stiffness of the machine where gravity, payload and `wrench` have moved it, with their
        geometric stiffness.
    wrench : (6,) array, optional
        With `preload`: ``[f, m]`` on the TCP, base frame, N and N m.

    Returns
    -------
    TcpStiffness

    Raises
    ------
    BeamstiffError
        When the robot is a mechanism, or entirely rigid.

    Examples
    --------
    >>> found = stiffness("ir663", {"q2": 0.17, "q8": 0.79})
    >>> found.stiffness.shape
    (6, 6)
    """
    machine = as_robot(robot)
    if wrench is not None and not preload:
        raise OptionError(
            "wrench",
            "needs --preload (preload=True). For the displacement under a load use beamstiff deflect ROBOT "
            "--wrench, or DATA.csv, a table of joint values and loads",
        )
    load = np.zeros(6) if wrench is None else six_numbers("wrench", wrench)
    try:
        structure, where = _placed(machine, reference_posture(machine) if q is None else q)
    except BeamstiffError:
        check_stiffness(machine)  # the better reason, where it is one
        raise
    if len(where.values) != 1:
        raise OptionError("q", f"found {len(where.values)} postures, expected one (tcp_stiffness takes many)")
    compliance = _compliance(structure, where, load if preload else None)
    elastic = () if preload else tuple(filter(is_elastic, machine.effects))
    coarse: list[str] = []
    if preload:
        coarse = coarse_beams(respond(structure, where, _nodal(structure, load), gravity=True))
    inverse, singular, rigid = None, "", np.zeros((0, 6))
    try:
        inverse = _inverse(structure, compliance, preload)[0]
    except BeamstiffError as error:
        rigid, singular = condensation.rigid_wrenches(compliance[0]), str(error)
        if not len(rigid) or len(rigid) == len(compliance[0]):  # refused for another reason
            raise
    pose = pose_of(structure.kinematics, where, machine.tcp)[0]
    others = [one for one in machine.effects if one not in elastic]
    effects = left_out(others, "its stiffness (beamstiff deflect includes them)")
    if elastic:
        told = effects_text(elastic)
        effects = (f"the stiffness includes, for small loads (1 N, 1 N m): {told}", *effects)
    return TcpStiffness(
        robot=machine,
        stiffness=inverse,
        compliance=compliance[0],
        tcp=pose[:3, 3],
        orientation=vector_from_rotation(pose[:3, :3]),
        variables=dict(zip(structure.kinematics.coupling.names, where.values[0].tolist(), strict=True)),
        preload=preload,
        rigid=rigid,
        singular=singular,
        guessed=_guessed(structure, where, compliance[0], load if preload else None),
        notes=(*robot_doubts(machine), *effects, *start_values(machine), *coarse),
    )


def tcp_compliance(robot: RobotLike | Structure, q: Joints | Posture | None = None) -> Array:
    """Return the compliance at the TCP of every posture, (P, 6, 6), base frame: ``[d, r] = C [f, m]``.

    Elastic effects of the robot are included, with what they do under 1 N and 1 N m; of a robot without some
    of them see `Robot.without_effects`.

    Parameters
    ----------
    robot : Robot, path, name of a bundled robot; or Structure from `compile_structure`
        Compile once where many calls follow.
    q : mapping of str to values, (P, A) array, or Posture, rad or m
        Actuated joint variables; those not named are 0.

    Raises
    ------
    BeamstiffError
        When a loop cannot close, or the robot is a mechanism there.

    Examples
    --------
    >>> tcp_compliance("ir663", {"q2": 0.17, "q8": [0.7, 0.8]}).shape
    (2, 6, 6)
    """
    return _compliance(*_placed(robot, q), None)


def tcp_stiffness(robot: RobotLike | Structure, q: Joints | Posture | None = None) -> Array:
    """Return the stiffness at the TCP of every posture, (P, 6, 6), the inverse of `tcp_compliance`.

    Parameters
    ----------
    robot, q
        As of `tcp_compliance`.

    Raises
    ------
    BeamstiffError
        Also when the TCP does not move at all in some direction.

    Examples
    --------
    >>> tcp_stiffness("cantilever").shape
    (1, 6, 6)
    """
    structure, where = _placed(robot, q)
    return _inverse(structure, _compliance(structure, where, None), False)


def forward_kinematics(robot: RobotLike, q: Joints | None = None, node: str | None = None) -> Array:
    """Return where the TCP, or another node, is in every posture: transforms (P, 4, 4) in the base frame.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
    q : mapping of str to values, or (P, A) array, rad or m
        Actuated joint variables; those not named are 0, passive ones are solved.
    node : str, optional
        Default the TCP.

    Raises
    ------
    BeamstiffError
        When a loop cannot close, or there is no such node.

    Examples
    --------
    >>> forward_kinematics("cantilever")[0, :3, 3].tolist()
    [1.0, 0.0, 0.0]
    """
    machine = as_robot(robot)
    kinematics = compile_kinematics(machine)
    return pose_of(kinematics, posture(kinematics, {} if q is None else q), node or machine.tcp)


def _placed(robot: RobotLike | Structure, q: Joints | Posture | None) -> tuple[Structure, Posture]:
    structure = robot if isinstance(robot, Structure) else compile_structure(as_robot(robot))
    if isinstance(q, Posture):
        return structure, q
    return structure, posture(structure.kinematics, {} if q is None else q)


def _compliance(structure: Structure, where: Posture, load: Array | None) -> Array:
    """Return the compliance of the machine under gravity and a load, or none but with effects, (P, 6, 6)."""
    if load is None:
        compliance = condensation.tcp_compliance(structure, where)
        if elastic := tuple(filter(is_elastic, structure.robot.effects)):
            compliance = compliance + _effects_compliance(structure.robot, elastic, where)
    else:
        compliance = loaded_compliance(structure, where, _nodal(structure, load), gravity=True, moved=False)
    if structure.robot.model is not None:
        compliance = compliance + compliance_correction(structure, where)[:, :, :6]
    return compliance


def _guessed(structure: Structure, where: Posture, compliance: Array, load: Array | None) -> Array:
    """Return the share (6,) of the compliance (6, 6) that is gone where start values are rigid."""
    robot, own = structure.robot, np.diagonal(compliance)
    if not robot.unmeasured:
        return np.zeros(6)
    rigid = robot.with_parameters(dict.fromkeys(robot.unmeasured, np.inf))
    left = np.diagonal(_compliance(compile_structure(rigid), where, load)[0])
    return np.asarray(1.0 - np.divide(left, own, out=np.ones(6), where=own > 0.0))


def _effects_compliance(robot: Robot, effects: Sequence[AddedEffect], where: Posture) -> Array:
    """Return what effects add to the compliance (P, 6, 6) at the TCP: the mean of 1 N, 1 N m either way."""
    names, count = [one.name for one in robot.actuated], len(where.values)
    q = np.repeat(where.values[:, : len(names)], 6, axis=0)  # the actuated variables come first
    machine = robot.model_copy(update={"effects": tuple(effects)})

    def moved(load: float) -> Array:
        loads, unread = np.tile(load * np.eye(6), (count, 1)), np.zeros((6 * count, 6))
        rows = make_measurements(names, q, tcp=robot.tcp, wrench=loads, displacement=unread)
        return effects_displacement(machine, rows).reshape(count, 6, 6)

    return np.asarray(0.5 * (moved(1.0) - moved(-1.0)).swapaxes(1, 2))


def _nodal(structure: Structure, load: Array) -> Array:
    return nodal_loads(structure, 1, {structure.robot.tcp: load})


def _inverse(structure: Structure, compliance: Array, loaded: bool) -> Array:
    what = f"robot {structure.robot.name!r}"
    try:
        return (loaded_stiffness if loaded else condensation.tcp_stiffness)(compliance, what)
    except BeamstiffError as error:
        check_stiffness(structure.robot)
        raise BeamstiffError(f"{error} (predict, which needs no stiffness: beamstiff deflect)") from None
