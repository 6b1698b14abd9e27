"""Signals of a ROS bag (`.mcap`, `.db3`, `.bag`, or a folder of rosbag2), by the library rosbags."""

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.signals import Signal, SignalKind

BAGS = (".mcap", ".db3", ".bag")
OTHER_EPOCH = 60.0  # s between stamps and recording beyond which the stamps are of another epoch
Readings = dict[tuple[str, SignalKind, tuple[str, ...], str], list[tuple[int, int, Any]]]


def is_bag(path: str | os.PathLike[str]) -> bool:
    """Tell whether a path is that of a bag: by its ending, or a folder with `metadata.yaml`."""
    file = Path(path)
    return file.suffix.lower() in BAGS or (file / "metadata.yaml").is_file()


def read_bag(path: str | os.PathLike[str], skip: Iterable[str] = ()) -> tuple[list[Signal], list[str]]:
    """Return the signals of a bag and notes on what was left out.

    JointState, PoseStamped, PointStamped, TransformStamped, WrenchStamped; times are those of the headers, s
    since the bag begins, or of the recording where headers have none. `skip`: topics that are left out.

    Raises BeamstiffError where the file is no such bag.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise BeamstiffError(f"{path}: reading bags needs rosbags: pip install 'beamstiff[logs]'") from None
    if not Path(path).exists():
        raise BeamstiffError(f"{path}: no such file")
    found: Readings = {}
    left_out: dict[str, str] = {}
    skipped = set(skip)
    try:
        with AnyReader([Path(path)], default_typestore=get_typestore(Stores.LATEST)) as bag:
            topics = {connection.topic for connection in bag.connections}
            wanted = [one for one in bag.connections if one.msgtype in TYPES and one.topic not in skipped]
            left_out = {one.topic: one.msgtype for one in bag.connections if one not in wanted}
            begin = bag.start_time
            for connection, recorded, raw in bag.messages(wanted) if wanted else ():
                message: Any = bag.deserialize(raw, connection.msgtype)
                stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
                for kind, columns, values in TYPES[connection.msgtype](message):
                    key = connection.topic, kind, columns, message.header.frame_id
                    found.setdefault(key, []).append((stamp - begin, recorded - begin, values))
    except Exception as error:  # of a foreign reader that meets a spoiled file: anything at all
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BeamstiffError(f"{path}: cannot be read as a bag: {reason}") from None
    if unknown := sorted(skipped - topics):
        raise BeamstiffError(f"{path}: --skip: there is no topic {unknown[0]!r}, found {listed(topics, 12)}")
    notes: list[str] = []
    signals = []
    for (topic, kind, columns, frame), readings in found.items():
        if "" in columns or len(set(columns)) < len(columns):
            raise BeamstiffError(f"{path}: {topic}: found joints without names, or two of one name")
        stamps = np.array([one[0] for one in readings], dtype=np.int64)
        received = np.array([one[1] for one in readings], dtype=np.int64)
        offset = float(np.median(received - stamps)) * 1e-9
        time = stamps * 1e-9
        if abs(offset) > OTHER_EPOCH:
            time = time + offset
            notes.append(f"{topic}: its stamps are of another epoch ({offset:.6g} s away): shifted by that")
        values = np.array([one[2] for one in readings], dtype=np.float64)
        finite = np.isfinite(values).all(axis=1)
        values = values[finite]
        if kind == "joints":
            values = np.unwrap(values, axis=0)
        if kind == "pose":
            values = _signs_continued(values)
        if len(values):
            signals.append(Signal(topic, kind, columns, values=values, time=time[finite], frame=frame))
        if lost := int((~finite).sum()):
            notes.append(f"{topic}: {lost} readings without a number were skipped")
    if left_out:
        told = [f"{topic} ({kind.rpartition('/')[2]})" for topic, kind in left_out.items()]
        notes.append(f"skipped: {listed(told, 12)}")
    return [signal.shifted(signal.time) for signal in signals], notes


Values = Iterable[tuple[SignalKind, tuple[str, ...], Any]]


def _joints(message: Any) -> Values:
    names = tuple(message.name)
    if len(message.position) == len(names) and names:
        yield "joints", names, message.position
    if len(message.effort) == len(names) and names:
        yield "torques", names, message.effort


def _point(message: Any) -> Values:
    yield "point", ("x", "y", "z"), _three(message.point)


def _pose(message: Any) -> Values:
    yield from _placed(message.pose.position, message.pose.orientation)


def _transform(message: Any) -> Values:
    yield from _placed(message.transform.translation, message.transform.rotation)


def _wrench(message: Any) -> Values:
    yield (
        "wrench",
        ("fx", "fy", "fz", "mx", "my", "mz"),
        (*_three(message.wrench.force), *_three(message.wrench.torque)),
    )


def _placed(position: Any, orientation: Any) -> Values:
    turned = np.array([orientation.x, orientation.y, orientation.z, orientation.w])
    length = float(np.linalg.norm(turned))
    if length < 0.5:  # publishers without an orientation leave it zero
        yield "point", ("x", "y", "z"), _three(position)
    else:
        yield "pose", ("x", "y", "z", "qx", "qy", "qz", "qw"), (*_three(position), *(turned / length))


def _three(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


TYPES: dict[str, Callable[[Any], Values]] = {
    "sensor_msgs/msg/JointState": _joints,
    "geometry_msgs/msg/PointStamped": _point,
    "geometry_msgs/msg/PoseStamped": _pose,
    "geometry_msgs/msg/TransformStamped": _transform,
    "geometry_msgs/msg/WrenchStamped": _wrench,
}


def _signs_continued(values: Any) -> Any:
    """Return poses with quaternions of the sign nearest to the one before."""
    result = values.copy()
    flips = np.sign(np.sum(values[1:, 3:] * values[:-1, 3:], axis=1))
    flips = np.where(flips == 0, 1.0, flips)
    result[1:, 3:] *= np.cumprod(flips)[:, None]
    return result
