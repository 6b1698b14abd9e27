"""K_C of a serial robot, in joint space: what a load on the tool adds to the stiffness of the joints.

Source: seed 000, eq. 9 (Chen and Kao, Int. J. Robotics Research 19 (2000) 835). The K_C of any structure, in
its finite elements, is in `fem.geometric_stiffness`.
"""

import numpy as np

from beamstiff.fem.structure import Structure
from beamstiff.robot.forward import chain_to, screws_of
from beamstiff.robot.frames import MOTIONS
from beamstiff.robot.kinematics import Posture
from beamstiff.se3 import Array, skew


def complementary_stiffness(structure: Structure, posture: Posture, wrench: Array) -> Array:
    """Return K_C of a serial robot under wrenches (6,) or (P, 6) at its TCP, (P, A, A).

    Columns ``dJ^T/dtheta_i w``: not symmetric when a moment acts.
    """
    kinematics = structure.kinematics
    poses = len(posture.values)
    wrench = np.broadcast_to(np.asarray(wrench, dtype=np.float64), (poses, 6))
    tcp = kinematics.node_index[structure.robot.tcp]
    chain = chain_to(kinematics, int(kinematics.node_frame[tcp]))
    screws = screws_of(kinematics, posture.values, posture.transforms, chain)
    directions = kinematics.coupling.matrix[:, : kinematics.coupling.actuated]
    result = np.zeros((poses, len(screws), len(screws)))
    twists = np.zeros((poses, len(screws), 6))
    rates = np.zeros((len(screws), directions.shape[1]))
    for at, screw in enumerate(screws):
        axis, arm = screw.axis.T, posture.node_positions[:, tcp] - screw.point.T
        turns = MOTIONS[screw.motion][1] == "turn"
        twists[:, at, :3] = np.cross(axis, arm) if turns else axis
        twists[:, at, 3:] = axis if turns else 0.0
        rates[at] = kinematics.coefficients[screw.frame, screw.motion] @ directions
    velocity, axes = twists[..., :3], twists[..., 3:]
    by_force = np.einsum("pja,pab,pib->pji", velocity, skew(wrench[:, :3]), axes)  # w . [a_i x v_j; .]
    by_moment = np.einsum("pja,pab,pib->pji", axes, skew(wrench[:, 3:]), axes)
    upstream = np.tril(np.ones((len(screws), len(screws))))  # i before j, or j itself
    result = upstream * (by_force + by_moment) + (1 - upstream) * by_force.swapaxes(-1, -2)
    return rates.T @ result @ rates
