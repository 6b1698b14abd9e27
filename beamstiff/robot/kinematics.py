"""Kinematics of a robot with its loops closed: postures and twist Jacobians, batched over poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.robot.closure import assembled, close_loops, closure_rates
from beamstiff.robot.description import Robot
from beamstiff.robot.forward import chain_to, node_positions, screws_of, twists_at
from beamstiff.robot.forward import forward as forward
from beamstiff.robot.frames import Kinematics as Kinematics
from beamstiff.robot.frames import compile_frames
from beamstiff.robot.parts import Variable
from beamstiff.se3 import Array

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot


@dataclass(frozen=True, eq=False)
class Posture:
    """A machine at P poses, its loops closed."""

    values: Array  # (P, V), rad or m: all variables, in the order of ``kinematics.coupling.names``
    transforms: Array  # (P, F + 1, 4, 4): transform base <- frame, in the order of ``kinematics.frame_names``
    node_positions: Array  # (P, N, 3), m: in the base frame, in the order of ``kinematics.node_names``

    def only(self, poses: slice | NDArray[np.int64]) -> Posture:
        """Return some of the poses."""
        return Posture(self.values[poses], self.transforms[poses], self.node_positions[poses])


class ClosedPosture(Posture):
    """A posture that follows from its values: where frames and nodes are is worked out when asked for."""

    kinematics: Kinematics | None = None  # by which it follows; none where it was changed since

    @classmethod
    def of(cls, kinematics: Kinematics, values: Array) -> ClosedPosture:
        """Return the posture of all variables (P, V)."""
        made = cls.__new__(cls)
        object.__setattr__(made, "kinematics", kinematics)
        object.__setattr__(made, "values", values)
        return made

    @cached_property
    def transforms(self) -> Array:
        """Transform base <- frame of every frame."""
        assert self.kinematics is not None
        return forward(self.kinematics, self.values)

    @cached_property
    def node_positions(self) -> Array:
        """Position of every node in the base frame."""
        assert self.kinematics is not None
        return node_positions(self.kinematics, self.transforms)

    def only(self, poses: slice | NDArray[np.int64]) -> Posture:
        """Return some of the poses."""
        if self.kinematics is None or "node_positions" in self.__dict__:  # known already
            return super().only(poses)
        return ClosedPosture.of(self.kinematics, self.values[poses])


def compile_kinematics(robot: Robot) -> Kinematics:
    """Return the kinematics of a robot: everything that is the same for all poses."""
    kinematics = compile_frames(robot)
    return assembled(kinematics) if robot.loops else kinematics


def actuated_values(robot: Robot, q: Mapping[str, ArrayLike] | ArrayLike) -> Array:
    """Return values of the actuated variables as a table (P, A), one row a pose; rad or m.

    By name, each a number or P of them (variables not named are 0), or as an array (A,) or (P, A) in the
    order of ``robot.actuated``.
    """
    names = [variable.name for variable in robot.actuated]
    if isinstance(q, Mapping):
        return _from_names(robot, names, q)
    values = _numbers(q, "the joint values")
    if values.ndim == 1:
        values = values[None]
    if values.ndim != 2 or values.shape[1] != len(names):
        raise BeamstiffError(
            f"found joint values of shape {values.shape}, expected {len(names)} in a row: "
            f"{listed(names, 12) or 'none'}"
        )
    _all_finite(values, names)
    return values


def _from_names(robot: Robot, names: list[str], q: Mapping[str, ArrayLike]) -> Array:
    given: dict[str, Array] = {}
    for name, value in q.items():
        if name not in names:
            for variable in robot.variables:
                if variable.name == name:
                    how = "is solved by loop closure" if variable.passive else f"follows {variable.equals}"
                    raise BeamstiffError(
                        f"{name!r} {how}: give values of the actuated variables {listed(names, 12)} only"
                    )
            raise BeamstiffError(
                f"unknown joint variable {name!r}{suggest(name, names)}, "
                f"expected {listed(names, 12) or 'none'}"
            )
        given[name] = _numbers(value, f"{name}")
        if given[name].ndim > 1:
            raise BeamstiffError(
                f"{name}: found values of shape {given[name].shape}, expected a number or a row"
            )
    lengths = {len(value) for value in given.values() if value.ndim}
    if len(lengths) > 1:
        raise BeamstiffError(
            f"found {listed(map(str, sorted(lengths)))} values for the joints of {robot.name!r}, "
            "expected as many for each"
        )
    values = np.zeros((lengths.pop() if lengths else 1, len(names)))
    for name, value in given.items():
        values[:, names.index(name)] = value
    _all_finite(values, names)
    return values


def _numbers(values: ArrayLike, what: str) -> Array:
    try:
        array = np.asarray(values)
        if (
            array.dtype.kind not in "iuf" and array.size
        ):  # text, truth values and complex numbers are no angles
            raise TypeError
        return array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise BeamstiffError(f"{what}: found {str(values)[:60]!r}, expected numbers") from None


def _all_finite(values: Array, names: list[str]) -> None:
    if not np.isfinite(values).all():
        pose, column = np.argwhere(~np.isfinite(values))[0]
        raise BeamstiffError(
            f"{names[column]}: found {values[pose, column]} (pose {pose}), expected a finite number"
        )


def posture(kinematics: Kinematics, q: Mapping[str, ArrayLike] | ArrayLike) -> Posture:
    """Return the machine at the given poses, its loops closed.

    Parameters
    ----------
    kinematics : Kinematics
    q : (P, A) array or anything that `actuated_values` takes, rad or m

    Raises
    ------
    BeamstiffError
        When a loop cannot close at one of the poses.
    """
    values, _, _ = close_loops(kinematics, actuated_values(kinematics.robot, q))
    return posture_at(kinematics, values)


def posture_at(kinematics: Kinematics, values: Array) -> Posture:
    """Return the machine where all variables (P, V) are known already, as from `close_loops`."""
    return ClosedPosture.of(kinematics, values)


def twist_jacobian(kinematics: Kinematics, posture: Posture, node: str) -> Array:
    """Return the Jacobian ``[v; w]`` of a node, base frame, by the actuated variables, (P, 6, A).

    ``J = T_a - T_p J_p^+ J_a``, with T the twists for unit rates of the actuated and passive variables and J
    the derivatives of the loops' gaps.
    """
    at = node_at(kinematics, node)
    chain = chain_to(kinematics, int(kinematics.node_frame[at]))
    screws = screws_of(kinematics, posture.values, posture.transforms, chain)
    point = posture.node_positions[:, at].T
    twists = np.moveaxis(twists_at(kinematics, screws, point, kinematics.coupling.matrix), -1, 0)
    actuated = kinematics.coupling.actuated
    jacobian: Array = np.ascontiguousarray(twists[:, :, :actuated])
    if kinematics.loops:
        rates = closure_rates(kinematics, posture.values, posture.transforms)
        jacobian = jacobian + twists[:, :, actuated:] @ rates
    return jacobian


def pose_of(kinematics: Kinematics, posture: Posture, node: str) -> Array:
    """Return the transforms (P, 4, 4) base <- node: orientation of the node's frame, position of the node."""
    at = node_at(kinematics, node)
    transforms = posture.transforms[:, kinematics.node_frame[at]].copy()
    transforms[:, :3, 3] = posture.node_positions[:, at]
    return transforms


def node_at(kinematics: Kinematics, name: str) -> int:
    """Return the number of a node, by its name."""
    if name not in kinematics.node_index:
        raise BeamstiffError(
            f"robot {kinematics.robot.name!r} has no node {name!r}{suggest(name, kinematics.node_names)}"
        )
    return kinematics.node_index[name]


def reference_posture(robot: Robot) -> Array:
    """Return the actuated joint values (A,) of the reference: mid limits, or a sample that closes."""
    kinematics = compile_kinematics(robot)
    q = sampled_postures(robot, 1000, 0)
    for some in (q[:1], q):
        closure = close_loops(kinematics, some, strict=False)
        if closure.closed.any():
            return np.asarray(some[int(np.argmax(closure.closed))])
    raise BeamstiffError(
        f"robot {robot.name!r}: none of {len(q)} postures closes the loops: {closure.reasons[0]}"
    )


def sampled_postures(robot: Robot, count: int, seed: int) -> Array:
    """Return actuated joint values (1 + count, A): the middle of the limits, then samples within them."""
    limits = np.array([_range(variable) for variable in robot.actuated], dtype=np.float64).reshape(-1, 2)
    drawn = np.random.default_rng(seed).uniform(limits[:, 0], limits[:, 1], (count, len(limits)))
    return np.concatenate([limits.mean(axis=1)[None], drawn])


def _range(variable: Variable) -> tuple[float, float]:
    if variable.limits is not None:
        return variable.limits
    return (-np.pi, np.pi) if variable.kind == "angle" else (0.0, 0.0)
