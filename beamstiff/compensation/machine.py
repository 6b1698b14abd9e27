"""Where the tool of the real robot is when its controller has been sent to a pose.

The controller turns poses into joint values with the robot that it knows. At these, the real robot has its
own geometry, sags under its weight, is compliant under the load and has its effects.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from beamstiff.compensation.path import Frames
from beamstiff.diagnosis.apply import bare_baseline, effects_displacement
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import predict
from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.measure.wrench import transport_wrench
from beamstiff.robot.description import Robot
from beamstiff.robot.frames import Kinematics
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import AddedEffect, AddedShape
from beamstiff.se3 import Array, rotation_from_vector

VISIBLE = 1e-6  # m
PROPORTIONAL = 0.02  # share by which what goes with the load may be off it: the loaded machine is stiffer


@dataclass(frozen=True, eq=False)
class Machine:
    """A controller and the robot that it moves."""

    controller: Robot  # whose geometry the controller takes for true; its stiffness and masses do not matter
    # the real one, calibrated, with masses, stiffness and `effects`; None: as the controller's
    actual: Robot | None = None
    frames: Frames = field(default_factory=Frames)  # whose tool the poses are of

    def __post_init__(self) -> None:
        names = [[variable.name for variable in robot.actuated] for robot in (self.controller, self.real)]
        if names[0] != names[1]:
            raise BeamstiffError(
                f"robot {self.real.name!r}: found the actuated variables {listed(names[1])}, expected those "
                f"of {self.controller.name!r}: {listed(names[0])}"
            )

    @cached_property
    def real(self) -> Robot:
        """The robot that moves; without those of its effects that are of measuring and move nothing."""
        robot = self.actual or self.controller
        moving = tuple(one for one in robot.effects if not _of_measuring(one))
        return robot if moving == robot.effects else robot.model_copy(update={"effects": moving})

    @property
    def measured(self) -> Array | None:
        """The middle (A,) of the joint values that the real robot's file was fitted at; None: unknown."""
        middle = {one.variable: 0.5 * (one.low + one.high) for one in self.real.fitted_ranges}
        names = [variable.name for variable in self.controller.actuated]
        return np.array([middle[name] for name in names]) if {*names} <= {*middle} else None

    @property
    def set_aside(self) -> tuple[AddedEffect, ...]:
        """Effects of the robot that are of measuring: a frame askew, a cell that misreads, a drift."""
        return tuple(one for one in (self.actual or self.controller).effects if _of_measuring(one))

    @cached_property
    def kinematics(self) -> Kinematics:
        """The controller's."""
        return compile_kinematics(self.controller)

    @cached_property
    def _real_kinematics(self) -> Kinematics:
        return compile_kinematics(self.real)

    def undeformed(self, q: Array) -> Array:
        """Return the poses of the real tool without weight, load and effects, (N, 4, 4), base frame."""
        kinematics = self._real_kinematics
        at = pose_of(kinematics, posture(kinematics, q), self.real.tcp)
        return np.asarray(at @ self.frames.tool)

    def moved(self, q: Array, wrench: Array, tip: Array, approached: Array | None = None) -> Array:
        """Return how weight, load and effects move the `tcp` node, (N, 6) ``[d, r]``, base frame.

        `q` (N, A). `wrench` (N, 6): on the tool at its tip, base frame. `tip` (N, 4, 4): where the tool is,
        for the lever arm of the load. `approached` (N, A): the directions in which the joints last moved;
        default as the states follow one another.
        """
        return predict(self.real, replace(self.rows(q, wrench, tip), approached=approached))

    def unproven(self, q: Array) -> dict[str, dict[str, float]]:
        """Return how far effects of the real robot move the unloaded tool, unproven by displacements, m.

        What an effect does to the unloaded robot too, drops out of displacements (loaded less unloaded). They
        show it all the same where it goes with the load: then it follows from what the load does. So counts
        what does not double where the weight does.

        `q` (N, A). Returns dict of str to dict of str to float: at most in these postures, by effect and
        parameter; nothing where all is proven.
        """
        if not len(q):  # no target within reach
            return {}
        heavy = self.real.model_copy(update={"gravity": tuple(2.0 * g for g in self.real.gravity)})
        rows = self.node_rows(q, np.zeros((len(q), 6)))
        bare = [bare_baseline(robot, rows) for robot in (self.real, heavy)] if self.real.effects else []
        found: dict[str, dict[str, float]] = {}
        for key in dict.fromkeys(one.label for one in self.real.effects):
            own = [one for one in self.real.effects if one.label == key]
            for name in dict.fromkeys(name for one in own for part in one.each for name in part.parameters):
                # shapes without it stay: where several stand for one effect only their sum has a sign
                alone = tuple(one.with_shapes(tuple(_only(part, name) for part in one.each)) for one in own)
                reduced = self.real.model_copy(update={"effects": alone})
                once, twice = (effects_displacement(reduced, rows, one)[:, :3] for one in bare)
                whole, off = (np.linalg.norm(part, axis=1) for part in (once, 2.0 * once - twice))
                size = float(np.minimum(whole, off).max(initial=0.0))
                if size > PROPORTIONAL * whole.max(initial=0.0) and size > VISIBLE:
                    found.setdefault(key, {})[name] = size
        return found

    def displaced(self, undeformed: Array, moved: Array) -> Array:
        """Return the poses (N, 4, 4) of the tool whose `tcp` node has moved by ``[d, r]`` (N, 6)."""
        node = undeformed @ np.linalg.inv(self.frames.tool)
        node[:, :3, 3] += moved[:, :3]
        node[:, :3, :3] = rotation_from_vector(moved[:, 3:]) @ node[:, :3, :3]
        return np.asarray(node @ self.frames.tool)

    def rows(self, q: Array, wrench: Array, tip: Array) -> Measurements:
        """Return the states as rows, with the load at the `tcp` node; arguments as of `moved`."""
        node = tip @ np.linalg.inv(self.frames.tool)
        return self.node_rows(q, transport_wrench(wrench, tip[:, :3, 3], node[:, :3, 3]))

    def node_rows(self, q: Array, wrench: Array) -> Measurements:
        """Return states (N, A) as rows, under loads (N, 6) at the `tcp` node, base frame."""
        names, tcp = [variable.name for variable in self.real.actuated], self.real.tcp
        kinematics = self._real_kinematics
        position, pose = pose_of(kinematics, posture(kinematics, q), tcp)[:, :3, 3], np.arange(len(q))
        return make_measurements(
            names, q, tcp=tcp, wrench=wrench, position=position, pose=pose, source="path"
        )


def _only(part: AddedShape, name: str) -> AddedShape:
    """Return a shape with one of its parameters alone."""
    kept = {key: value for key, value in part.parameters.items() if key == name}
    return part.model_copy(update={"parameters": kept})


def _of_measuring(effect: AddedEffect) -> bool:
    return effect.effect in EFFECTS and EFFECTS[effect.effect].family == "measurement"
