"""Whether a URDF and the frames in its extension describe the same machine."""

from __future__ import annotations

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.robot.description import Robot
from beamstiff.robot.forward import forward
from beamstiff.robot.frames import all_values, compile_frames
from beamstiff.se3 import Array

POSTURES = 5
SAME = 1e-9  # rad, and of the machine's size


def disagreement(tree: Robot, robot: Robot) -> str:
    """Return what differs between frames of the same name, or an empty text.

    Passive variables count as free here: loops are not closed.
    """
    try:
        one, other = compile_frames(tree), compile_frames(robot)
    except BeamstiffError as error:
        return str(error)
    free = [*other.coupling.free]
    unknown = [name for name in one.coupling.free if name not in free]
    if unknown:
        return f"the joint {listed(unknown)} moves none of the frames"
    generator = np.random.default_rng(0)
    values = generator.uniform(-1.0, 1.0, (POSTURES, len(free)))
    same = values[:, [free.index(name) for name in one.coupling.free]]
    placed: list[Array] = [forward(one, all_values(one, same)), forward(other, all_values(other, values))]
    size = max(one.size, other.size, 1.0)
    inner = {joint.nodes[0] for joint in tree.joints}  # nodes that are no links; their frames are ours alone
    for name in dict.fromkeys(node.frame for node in tree.nodes if node.name not in inner):
        if name in other.frame_index:
            at = one.frame_index[name]
            gap = np.abs(placed[0][:, at] - placed[1][:, other.frame_index[name]]).max()
            if gap > SAME * size:
                return f"the frame {name!r} stands {gap:.3g} (m or rad) beside the link of this name"
    return ""
