"""More targets along a path, so that no step is longer than the deviation takes to change."""

from dataclasses import replace

import numpy as np

from beamstiff.compensation.follow import between
from beamstiff.compensation.path import ToolPath
from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array, vector_from_rotation

MOST = 200_000  # targets


def resample(path: ToolPath, step: float = np.inf, angle: float = np.inf) -> ToolPath:
    """Return the path with targets put in between, evenly: along straight lines, turning about one axis.

    `step`, `angle`: largest distance, m, and turn, rad, from a target to the next. Returns ToolPath: the
    targets of old are all there. The others are called ``P1+1/4``, one of four parts of the way from P1 to
    its successor; loads and columns are interpolated linearly.
    """
    if not (step > 0 and angle > 0):
        raise BeamstiffError(f"found the steps {step:g} m and {angle:g} rad, expected positive ones")
    if len(path) < 2:
        return path
    poses = path.poses
    way = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    turn = np.linalg.norm(vector_from_rotation(poses[:-1, :3, :3].swapaxes(1, 2) @ poses[1:, :3, :3]), axis=1)
    parts = np.maximum(1.0, np.ceil(np.maximum(way / step, turn / angle) - 1e-9))
    if parts.sum() >= MOST:
        raise BeamstiffError(
            f"{path.source}: found steps for {parts.sum():.0f} targets, expected {MOST} at most"
        )
    counts = parts.astype(np.int64)
    segment = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = number / counts[segment]
    new = between(poses[segment], poses[segment + 1], share)
    new[number == 0] = poses[:-1]

    def along(values: Array) -> Array:
        weight = share if values.ndim == 1 else share[:, None]
        inner = (1 - weight) * values[segment] + weight * values[segment + 1]
        return np.concatenate([inner, values[-1:]])

    names = [
        path.names[at] if part == 0 else f"{path.names[at]}+{part}/{counts[at]}"
        for at, part in zip(segment.tolist(), number.tolist(), strict=True)
    ]
    return replace(
        path,
        names=(*names, path.names[-1]),
        lines=np.concatenate([path.lines[segment], path.lines[-1:]]),
        poses=np.concatenate([new, poses[-1:]]),
        turns=np.concatenate([path.turns[segment], path.turns[-1:]]),
        wrench=None if path.wrench is None else along(path.wrench),
        columns={name: along(values) for name, values in path.columns.items()},
        stated_postures=tuple(
            path.stated_postures[at] if part == 0 else None
            for at, part in zip([*segment.tolist(), len(path) - 1], [*number.tolist(), 0], strict=True)
            if path.stated_postures
        ),
        joints=None,
        files=(),
    )
