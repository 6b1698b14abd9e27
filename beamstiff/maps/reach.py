"""Joint values that bring the TCP to the points of a grid, all in the configuration of one posture.

Two postures are of one configuration where the straight way between their joint values meets no singular
posture: none of shoulder, elbow and wrist is turned over on it. Points are started from postures nearby, then
from solved points beside them; what is found depends on the points that are given together, on nothing else.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.maps.quantities import Reason
from beamstiff.robot.closure import close_loops
from beamstiff.robot.frames import compile_frames
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import Kinematics, pose_of, posture_at, twist_jacobian
from beamstiff.robot.parts import Variable
from beamstiff.se3 import Array

Mask = NDArray[np.bool_]

POOL = 2048  # random postures, of which those of the configuration are started from
ROUNDS = 2  # of starts from these
SWEEPS = 8  # of starts from points beside
RESTARTS = 12  # to find out why a point is not reached
STEPS = 24  # along the way between two postures
SINGULAR = 1e-5  # least over largest singular value
NEARLY = 2e-7  # m, rad: where an arm is stretched, the last digits cost more steps than they are worth
AT_LIMIT = 1e-9  # rad, m


@dataclass(frozen=True, eq=False)
class Reach:
    """How to get to points in the configuration of a posture."""

    kinematics: Kinematics
    start: Array  # (A,), rad or m: the posture
    turned: bool  # whether orientations are to be met
    pool: Array  # (K, A), rad or m: postures of its configuration, from `postures_of_configuration`

    def check(self) -> None:
        """Refuse a posture that is of no configuration: outside the limits, or singular."""
        robot = self.kinematics.robot
        for variable, value in zip(robot.actuated, self.start.tolist(), strict=True):
            if variable.limits is not None and not within(np.array([value]), *variable.limits).all():
                raise BeamstiffError(
                    f"the posture held has {variable.name} = {value:.6g}, outside its limits "
                    f"{variable.limits[0]:.6g} to {variable.limits[1]:.6g}: give one within them"
                )
        values = np.linalg.svd(self._jacobian(self.start[None])[0], compute_uv=False)[0]
        if values[-1] <= SINGULAR * values[0]:
            raise BeamstiffError(
                "the posture held is singular, where configurations meet: give one of the configuration that "
                "is meant"
            )

    def solve(self, targets: Array) -> tuple[Array, NDArray[np.int8]]:
        """Return actuated values (P, A) at targets (P, 4, 4) or (P, 3), and reasons (P,).

        Of a target in another configuration they are of that; NaN where it is not reached at all.
        """
        q = np.full((len(targets), self.start.size), np.nan)
        reasons = np.full(len(targets), Reason.OUT_OF_REACH, dtype=np.int8)
        nearest = self._nearest(targets)
        for number in range(min(ROUNDS, nearest.shape[1])):
            todo = np.flatnonzero(reasons != Reason.COMPUTED)
            self._try(targets, todo, self.pool[nearest[todo, number]], q, reasons)
        points = targets[:, :3, 3] if self.turned else targets
        tried = np.full(len(targets), -1)
        for _ in range(SWEEPS):
            solved = np.flatnonzero(reasons == Reason.COMPUTED)
            todo = np.flatnonzero(reasons != Reason.COMPUTED)
            if not solved.size:
                break
            beside = solved[((points[todo, None] - points[solved]) ** 2).sum(axis=2).argmin(axis=1)]
            new = beside != tried[todo]
            tried[todo] = beside
            if not self._try(targets, todo[new], q[beside[new]], q, reasons):
                break
        for reason, kinematics in (
            (Reason.OTHER_CONFIGURATION, self.kinematics),
            (Reason.LIMITS, self._unlimited),
        ):
            todo = np.flatnonzero(reasons == Reason.OUT_OF_REACH)
            if todo.size:
                found, reached = self._approach(kinematics, targets[todo], self.start, RESTARTS)
                q[todo[reached]], reasons[todo[reached]] = found[reached], reason
        return q, reasons

    def _try(
        self, targets: Array, todo: NDArray[np.intp], start: Array, q: Array, reasons: NDArray[np.int8]
    ) -> bool:
        """Look for some targets from a start each, note what is found, and tell whether anything was."""
        if not todo.size:
            return False
        found, reached = self._approach(self.kinematics, targets[todo], start, 0)
        there = np.flatnonzero(reached)
        same = self.same_configuration(found[there])
        q[todo[there]] = found[there]
        reasons[todo[there]] = np.where(same, Reason.COMPUTED, Reason.OTHER_CONFIGURATION)
        return bool(same.any())

    def _approach(
        self, kinematics: Kinematics, targets: Array, start: Array, restarts: int
    ) -> tuple[Array, Mask]:
        """Return joint values (P, A), of their turns the nearest ones, and whether they get there."""
        found = inverse_geometry(kinematics, targets, start=start, restarts=restarts)
        reached = (found.position_error <= NEARLY) & (found.rotation_error <= NEARLY)
        return self.near_turns(found.q), reached

    def same_configuration(self, q: Array) -> Mask:
        """Tell of postures (P, A) whether the straight way from the one held meets no singular posture."""
        share = np.linspace(0.0, 1.0, STEPS + 1)[:, None, None]
        way = (self.start + share * (q - self.start)).reshape(-1, self.start.size)
        jacobian, closed = self._jacobian(way)
        rows = jacobian.shape[1]
        steps = jacobian.reshape(STEPS + 1, len(q), rows, self.start.size)
        # the determinant of neighbours' product, of the smaller size: its sign turns where one of them does
        ahead, behind = steps[1:], steps[:-1].swapaxes(-1, -2)
        product = ahead @ behind if rows <= steps.shape[-1] else behind @ ahead
        crossed = np.linalg.det(product) <= 0.0
        known = closed.reshape(STEPS + 1, len(q))
        return np.asarray(~(crossed & known[1:] & known[:-1]).any(axis=0))

    @cached_property
    def _unlimited(self) -> Kinematics:
        robot = self.kinematics.robot
        free = [variable.model_copy(update={"limits": None}) for variable in robot.variables]
        frames = compile_frames(robot.model_copy(update={"variables": tuple(free)}))
        return replace(frames, assembly=self.kinematics.assembly)  # other limits could mean another one

    def _nearest(self, targets: Array) -> NDArray[np.intp]:
        """Return which of the pool are nearest to each target, (P, ROUNDS)."""
        values = close_loops(self.kinematics, self.pool, strict=False).values
        at = pose_of(self.kinematics, posture_at(self.kinematics, values), self.kinematics.robot.tcp)
        positions = targets[:, :3, 3] if self.turned else targets
        away = ((positions[:, None] - at[None, :, :3, 3]) ** 2).sum(axis=2) / self.kinematics.size**2
        if self.turned:  # |R - S|^2 = 6 - 2 trace(R^T S)
            away += 6.0 - 2.0 * targets[:, :3, :3].reshape(-1, 9) @ at[:, :3, :3].reshape(-1, 9).T
        return np.argsort(away, axis=1, kind="stable")[:, :ROUNDS]

    def _jacobian(self, q: Array) -> tuple[Array, Mask]:
        """Return Jacobians (P, 6 or 3, A) without units at postures (P, A), and where there is one."""
        values, closed, _ = close_loops(self.kinematics, q, strict=False)
        lengths = np.array([v.kind == "length" for v in self.kinematics.robot.actuated])
        size = self.kinematics.size
        result = np.zeros((len(q), 6 if self.turned else 3, self.start.size))
        try:
            found = twist_jacobian(
                self.kinematics, posture_at(self.kinematics, values[closed]), self.kinematics.robot.tcp
            )
        except BeamstiffError:  # a loop is singular on the way: nothing is known of the other side
            return result, np.zeros(len(q), dtype=np.bool_)
        found = found * np.where(lengths, size, 1.0)
        found[:, :3] /= size
        result[closed] = found[:, : result.shape[1]]
        return result, closed

    def near_turns(self, q: Array) -> Array:
        """Return the same postures (P, A) by whole turns nearer to the one held, where limits let them."""
        robot = self.kinematics.robot
        if any(variable.equals is not None for variable in robot.variables):
            return q  # what follows at half the speed would not come back
        result = q.copy()
        for at, variable in enumerate(robot.actuated):
            if variable.kind == "angle":
                turns = np.round((q[:, at] - self.start[at]) / (2 * np.pi))
                nearer = q[:, at] - 2 * np.pi * turns
                low, high = variable.limits or (-np.inf, np.inf)
                result[:, at] = np.where((nearer >= low) & (nearer <= high), nearer, q[:, at])
        return result


def postures_of_configuration(kinematics: Kinematics, start: Array, turned: bool) -> Array:
    """Return postures (K, A) of the configuration of one (A,), that one first: to start from."""
    around = Reach(kinematics, start, turned, start[None])
    around.check()
    robot, size = kinematics.robot, kinematics.size
    ends = [v.limits or ((-np.pi, np.pi) if v.kind == "angle" else (-size, size)) for v in robot.actuated]
    low, high = np.array(ends).T
    q = np.random.default_rng(0).uniform(low, high, (POOL, low.size))
    q = around.near_turns(q[close_loops(kinematics, q, strict=False).closed])
    return np.concatenate([start[None], q[around.same_configuration(q)]])


def within(values: Array, low: float, high: float) -> Mask:
    """Tell where values lie within limits, but for rounding."""
    return (values >= low - AT_LIMIT) & (values <= high + AT_LIMIT)


def outside_limits(variables: Iterable[Variable], values: Array) -> Mask:
    """Tell where some of the variables, one a column of (P, V), lies outside its limits; NaN does not."""
    outside = np.zeros(len(values), dtype=np.bool_)
    for variable, column in zip(variables, values.T, strict=True):
        if variable.limits is not None:
            outside |= ~(within(column, *variable.limits) | np.isnan(column))
    return outside
