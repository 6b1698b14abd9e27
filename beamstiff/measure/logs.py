"""A log of a running machine as a table of measured states: one row a plateau and reflector.

Clocks are brought together (`clock_lag`), windows found in which the machine stands still (`plateaus`), and
the readings of each averaged, with the standard deviation of the mean.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.measure.clock_lag import ClockLag, LagError, clock_lag
from beamstiff.measure.plateaus import SHORTEST, Window, still_windows
from beamstiff.measure.signals import LEAST_NOISE, Signal
from beamstiff.measure.wrench import wrench_from_sensor
from beamstiff.measure.writer import table_text
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array, vector_from_rotation

BASE_FRAMES = ("", "base", "base_link", "base_footprint", "world", "map")
SAME = 1e-3  # rad, m: joint values nearer than this are one pose
POOLED = 10.0  # readings that the common noise counts for beside a window's own
MOST_LAG = 30.0  # s
SMOOTH = 0.2  # s
SAID = 0.5  # s of a window that is cut, from which its reason is said


@dataclass(frozen=True)
class LogTable:
    """A log as a table of measurements."""

    text: str  # CSV, SI
    count: int  # rows
    notes: tuple[str, ...]
    windows: tuple[Window, ...]  # kept and cut, on the clock of the joints
    lags: Mapping[str, ClockLag]  # by source
    signals: tuple[Signal, ...]  # on the clock of the joints

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds of it."""
        return {
            "rows": self.count,
            "windows": [
                {"start": w.start, "end": w.end, "kept": w.kept, "reason": w.reason} for w in self.windows
            ],
            "lags": {
                name: {"lag": one.lag, "drift": one.drift, "std": one.std, "motions": one.motions}
                for name, one in self.lags.items()
            },
            "notes": list(self.notes),
        }


def table_of_log(
    signals: Sequence[Signal],
    name: str,
    *,
    points: Mapping[str, str] | None = None,
    lag: float | None = None,
    robot: Robot | None = None,
    shortest: float = SHORTEST,
) -> LogTable:
    """Return a log as a table of measurements.

    `points`: nodes of reflectors by source; by default all positions are of one, or of nodes called like
    their sources. `lag`, s: of the points' clock, instead of finding it; a wrench's is the joints' then.
    `robot`: whose joints are written, and in whose frames wrenches are given. `shortest`, s: of a window
    that is kept.

    Raises BeamstiffError where joints or positions are missing, clocks cannot be brought together, or the
    machine never stands still.
    """
    joints = _joints(signals, name, robot)
    places = [one for one in signals if one.kind in ("point", "pose")]
    if unknown := sorted(set(points or ()) - {one.name for one in places}):
        hint = suggest(unknown[0], [one.name for one in places])
        raise BeamstiffError(
            f"{name}: --point: there are no positions in {unknown[0]!r}{hint}, found "
            f"{listed([one.name for one in places], 12) or 'none'}"
        )
    places = [one for one in places if not points or one.name in points]
    if not places:
        raise BeamstiffError(
            f"{name}: found no measured position, expected a PointStamped, PoseStamped or TransformStamped"
        )
    nodes = _nodes(places, points, robot, name)
    notes: list[str] = []
    lags: dict[str, ClockLag] = {}
    moved = [joints]
    for place in places:
        if lag is None:
            try:
                lags[place.name] = clock_lag(joints, place, MOST_LAG)
            except LagError as error:
                raise BeamstiffError(
                    f"{name}: {error}; say it with --lag TIME (--lag 0s where one clock stamped both)"
                ) from None
        else:
            lags[place.name] = ClockLag(lag, 0.0, 0.0, 0.0, 0)
        moved.append(place.shifted(lags[place.name].corrected(place.time)))
        notes.append(_of_the_lag(place.name, lags[place.name]))
    others = [one for one in signals if one.kind == "wrench"]
    if len(others) > 1:
        raise BeamstiffError(
            f"{name}: found wrenches in {listed([one.name for one in others])}, expected one (--skip)"
        )
    for one in others:
        try:  # a tool's weight turns with the joints in the frame of the sensor
            found = None if lag is not None else clock_lag(joints, _smooth(one), MOST_LAG)
        except LagError:
            notes.append(f"{one.name}: shows no motion: its clock is taken for that of the joints")
            found = None
        if found is not None:
            lags[one.name] = found
            notes.append(_of_the_lag(one.name, found))
        moved.append(one if found is None else one.shifted(found.corrected(one.time)))
    _check_overlap(moved, name)
    windows = still_windows(moved, shortest)
    kept = [window for window in windows if window.kept]
    if not kept:
        reasons = [window.reason for window in windows if window.reason != "moves"]
        why = f": {reasons[0]}" if reasons else ""
        raise BeamstiffError(f"{name}: the machine stands still nowhere for {shortest:g} s{why}")
    notes += _of_the_windows(windows)
    torques = next((one for one in signals if one.kind == "torques"), None)
    columns, count = _columns(moved, torques, kept, nodes, robot, name, notes)
    text = table_text([f"source: {name}"], columns)
    return LogTable(text, count, tuple(notes), tuple(windows), lags, tuple(moved))


def _smooth(wrench: Signal) -> Signal:
    """Return the means of forces over `SMOOTH` about each reading: load cells are noisy."""
    half = round(0.5 * SMOOTH / wrench.interval)
    total = np.cumsum(np.concatenate([np.zeros((1, wrench.values.shape[1])), wrench.values]), axis=0)
    at = np.arange(len(wrench))
    low, high = np.maximum(at - half, 0), np.minimum(at + half + 1, len(wrench))
    return replace(wrench, values=(total[high] - total[low]) / (high - low)[:, None])


def plain_name(joint: str) -> str:
    """Return a joint's name as a robot file may have it (`robot.link_tree`)."""
    return re.sub(r"[^A-Za-z0-9_]", "_", joint)


def _joints(signals: Sequence[Signal], name: str, robot: Robot | None) -> Signal:
    """Return the joints of the robot, or all of the source that has most of them."""
    found = [one for one in signals if one.kind == "joints" and len(one) > 2]
    if not found:
        raise BeamstiffError(f"{name}: found no joint values, expected a JointState")
    if robot is None:
        return max(found, key=lambda one: (len(one.columns), len(one)))
    wanted = [variable.name for variable in robot.actuated]
    for one in found:
        names = [plain_name(column) for column in one.columns]
        if set(wanted) <= set(names):
            at = [names.index(column) for column in wanted]
            return Signal(one.name, "joints", tuple(one.columns[i] for i in at), one.time, one.values[:, at])
    names = [plain_name(column) for one in found for column in one.columns]
    missing = next(column for column in wanted if column not in names)
    raise BeamstiffError(
        f"{name}: joint {missing!r} of robot {robot.name!r} is missing{suggest(missing, names)}, found "
        f"{listed(names, 12)}; a joint that is not moved is held by convert ROBOT --hold {missing}=VALUE"
    )


def _nodes(
    places: Sequence[Signal], points: Mapping[str, str] | None, robot: Robot | None, name: str
) -> dict[str, str]:
    """Return the node of each source of positions; empty for one at the TCP."""
    if len(places) == 1 and not points:
        return {places[0].name: ""}
    nodes = {one.name: (points or {}).get(one.name, plain_name(one.name.strip("/"))) for one in places}
    known = [node.name for node in robot.nodes] if robot is not None else list(nodes.values())
    for source, node in nodes.items():
        if node not in known:
            raise BeamstiffError(
                f"{name}: {source}: {node!r} is no node of the robot{suggest(node, known)}; say which "
                f"reflector it is with --point NODE={source}"
            )
    return nodes


def _of_the_lag(source: str, lag: ClockLag) -> str:
    if not lag.motions:
        return f"{source}: lag {lag.lag:.3f} s, as given"
    drift = f", drift {1e6 * lag.drift:.0f} ppm" if lag.drift else ""
    return (
        f"{source}: its clock shows {lag.lag:+.3f} s (std {lag.std:.3f} s{drift}) against the joints', from "
        f"{lag.motions} motions; corrected"
    )


def _of_the_windows(windows: Sequence[Window]) -> list[str]:
    cut = [
        window
        for window in windows
        if window.reason not in ("", "moves") and window.end - window.start >= SAID
    ]
    kept = sum(window.kept for window in windows)
    moves = sum(window.reason == "moves" for window in windows)
    return [
        f"{kept} plateaus kept, {moves} motions and {len(cut)} other windows cut",
        *(f"cut {window.start:.2f} s to {window.end:.2f} s: {window.reason}" for window in cut),
    ]


def _check_overlap(signals: Sequence[Signal], name: str) -> None:
    for one in signals[1:]:
        if one.time[0] > signals[0].time[-1] or one.time[-1] < signals[0].time[0]:
            raise BeamstiffError(
                f"{name}: {one.name} ({one.time[0]:.1f} s to {one.time[-1]:.1f} s) and {signals[0].name} "
                f"({signals[0].time[0]:.1f} s to {signals[0].time[-1]:.1f} s) have no time in common"
            )


def _columns(
    signals: Sequence[Signal],
    torques: Signal | None,
    kept: Sequence[Window],
    nodes: Mapping[str, str],
    robot: Robot | None,
    name: str,
    notes: list[str],
) -> tuple[dict[str, list[str]], int]:
    """Return the cells of the table by header, and how many rows it has."""
    joints = signals[0]
    q = window_means(joints, kept)[0]
    rows: list[dict[str, float | str]] = []
    missed = 0
    averaged = {one.name: window_means(one, kept) for one in signals[1:]}
    load = next((one for one in signals if one.kind == "wrench"), None)
    wrench = None if load is None else _in_base(load, averaged[load.name][0], q, joints, robot, name, notes)
    effort = None if torques is None else window_means(torques, kept)[0]
    poses = _poses(q)
    origin = min(one.time[0] for one in signals)
    for at, window in enumerate(kept):
        state: dict[str, float | str] = {
            plain_name(column): value for column, value in zip(joints.columns, q[at], strict=True)
        }
        if torques is not None and effort is not None:
            of = dict(zip(torques.columns, effort[at], strict=True))
            state |= {f"tau_{plain_name(column)}": of[column] for column in joints.columns if column in of}
        if wrench is not None:
            state |= dict(zip(WRENCH, wrench[at], strict=True))
        for place in signals[1:]:
            if place.kind == "wrench":
                continue
            mean, std = (one[at] for one in averaged[place.name])
            if np.isnan(mean[:3]).any():
                missed += 1
                continue
            row = state | dict(zip(POSITION, mean[:3], strict=True))
            row |= dict(zip([f"sigma_{column}" for column in POSITION], std[:3], strict=True))
            if place.kind == "pose":
                row |= dict(zip(TURNED, _rotation_vector(mean[3:]), strict=True))
                # a small turn moves the vector part of a quaternion by half its angle
                row |= dict.fromkeys(
                    [f"sigma_{column}" for column in TURNED], 2.0 * float(np.sqrt(np.mean(std[3:] ** 2)))
                )
            row |= {"point": nodes[place.name]} if nodes[place.name] else {}
            rows.append(row | {"pose": f"{poses[at]}", "t [s]": 0.5 * (window.start + window.end) - origin})
    if not rows:
        raise BeamstiffError(f"{name}: no position was read while the machine stood still")
    if missed:
        notes.append(f"{missed} times a point was not seen in a plateau: no row")
    headers = list(dict.fromkeys(header for row in rows for header in row))
    return {header: [_cell(row.get(header, np.nan)) for row in rows] for header in headers}, len(rows)


WRENCH = ("fx [N]", "fy [N]", "fz [N]", "mx [N*m]", "my [N*m]", "mz [N*m]")
POSITION, TURNED = ("x [m]", "y [m]", "z [m]"), ("a [rad]", "b [rad]", "c [rad]")


def _cell(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return "" if np.isnan(value) else repr(float(value))


def window_means(signal: Signal, windows: Sequence[Window]) -> tuple[Array, Array]:
    """Return the means (W, D) of a signal in windows and their standard deviations (W, D); NaN where unread.

    Readings one after the other are alike where the noise is slow: the variance of the mean counts their
    correlation, common to all windows (Bartlett 1946). The variance of a window is that of its own readings
    and, counting as ten more, of all windows, so that a few that agree by chance do not rule a fit.
    """
    width = signal.values.shape[1]
    mean = np.full((len(windows), width), np.nan)
    squares, counts = np.zeros((len(windows), width)), np.zeros(len(windows))
    lagged: list[Array] = []
    for at, window in enumerate(windows):
        inside = slice(*np.searchsorted(signal.time, [window.start, window.end]))
        values = signal.values[inside]
        counts[at] = len(values)
        if len(values):
            mean[at] = values.mean(axis=0)
            away = values - mean[at]
            squares[at] = (away**2).sum(axis=0)
            lagged.append(away)
    freedom = np.maximum(counts - 1, 0.0)
    least = LEAST_NOISE[signal.kind] / np.sqrt(12.0)
    common = squares.sum(axis=0) / max(float(freedom.sum()), 1.0)
    own = (squares + POOLED * common) / (freedom + POOLED)[:, None]
    fewer = np.minimum(_correlation_time(lagged), np.maximum(counts, 1.0)[:, None])
    with np.errstate(divide="ignore"):
        std = np.sqrt(own * fewer / np.where(counts > 0, counts, np.nan)[:, None])
    return mean, np.maximum(std, least)


def _correlation_time(away: Sequence[Array]) -> Array:
    """Return how many readings count for one (D,), from their correlation up to where it vanishes."""
    width = away[0].shape[1] if away else 0
    variance = np.sum([(one**2).sum(axis=0) for one in away], axis=0) / max(sum(map(len, away)), 1)
    result, going = np.ones(width), variance > 0
    longest = max((len(one) for one in away), default=1)
    for lag in range(1, min(longest // 2, 500)):
        pairs = [one for one in away if len(one) > 2 * lag]
        if not pairs or not going.any():
            break
        products = np.sum([(one[lag:] * one[:-lag]).sum(axis=0) for one in pairs], axis=0)
        alike = (
            products / max(sum(len(one) - lag for one in pairs), 1) / np.where(variance > 0, variance, 1.0)
        )
        going &= alike > 0.05
        result += np.where(going, 2.0 * alike, 0.0)
    return np.asarray(result)


def _rotation_vector(quaternion: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(vector_from_rotation(Rotation.from_quat(quaternion).as_matrix()))


def _poses(q: Array) -> list[int]:
    """Return a number for every configuration (W,): the same for those that are the same."""
    known: list[Array] = []
    numbers = []
    for values in q:
        number = next((at for at, one in enumerate(known) if np.abs(one - values).max() < SAME), len(known))
        if number == len(known):
            known.append(values)
        numbers.append(number)
    return numbers


def _in_base(
    load: Signal, wrench: Array, q: Array, joints: Signal, robot: Robot | None, name: str, notes: list[str]
) -> Array:
    """Return wrenches (W, 6) on the tool at the TCP, base frame."""
    if np.isnan(wrench).any():
        raise BeamstiffError(f"{name}: {load.name}: found no load while the machine stood still")
    frame = load.frame.strip("/")
    nodes = [] if robot is None else [node.name for node in robot.nodes]
    if robot is not None and frame in nodes:
        order = [plain_name(column) for column in joints.columns]
        values = q[:, [order.index(variable.name) for variable in robot.actuated]]
        kinematics = compile_kinematics(robot)
        placed = posture(kinematics, values)
        sensor, tool = (pose_of(kinematics, placed, node) for node in (frame, robot.tcp))
        notes.append(
            f"{load.name}: carried from {frame!r} to the TCP in the base frame, its weight not taken off"
        )
        return wrench_from_sensor(wrench, sensor[:, :3, :3], sensor[:, :3, 3], tool[:, :3, 3])
    if frame in BASE_FRAMES:
        notes.append(f"{load.name}: taken as the wrench on the tool at the TCP, base frame ({frame!r})")
        return wrench
    raise BeamstiffError(
        f"{name}: {load.name}: its wrenches are in the frame {frame!r}, expected the base's; give a robot "
        f"with a node of that name (--like ROBOT), or leave it out (--skip {load.name})"
    )
