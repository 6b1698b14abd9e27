"""Campaigns on the KR240-2 with an effect put in by closed forms of first order, none the library's own."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array
from tests.diagnosis.machines import POSITION, ROTATION, Arm, arm_at, kr240, rows_of

STEPS = np.array([0.3, 0.6, 1.0, 0.5, -0.6, -1.0])
# of the drives, against the model's: what a fit has to find first
REAL = np.array([1.15, 0.9, 1.1, 0.85, 1.2, 0.95])


def compliances() -> Array:
    """Return the compliances (6,) of the real machine's drives."""
    return 1 / (REAL * [kr240().parameter(name) for name in kr240().identify])


@dataclass(frozen=True)
class Plan:
    """Postures, loads and times: what effects are put on."""

    q: Array
    wrench: Array
    pose: Array
    step: Array
    time: Array

    @property
    def arm(self) -> Arm:
        return arm_at(self.q)

    @property
    def torque(self) -> Array:
        return self.arm.torque(self.wrench)

    @property
    def elastic(self) -> Array:
        """Displacement (N, 6) by the drives alone, linear."""
        return sum_of(self.arm, self.torque * compliances())


def sum_of(arm: Arm, slips: Array) -> Array:
    return np.sum([arm.slipped(slips[:, joint], joint) for joint in range(6)], axis=0)


def plan(poses: int = 10, seed: int = 0, steps: Array = STEPS) -> Plan:
    """Return postures about the middle of the workspace, in each a load cycle of its own direction."""
    rng = np.random.default_rng(seed)
    middle = np.array([0.0, 1.1, -1.4, 0.0, 0.6, 0.0])
    q = middle + rng.uniform(-1, 1, (poses, 6)) * [1.5, 0.6, 0.7, 1.5, 1.0, 1.5]
    direction = rng.standard_normal((poses, 6))
    direction[:, :3] *= 1500 / np.linalg.norm(direction[:, :3], axis=1, keepdims=True)
    direction[:, 3:] *= 250 / np.linalg.norm(direction[:, 3:], axis=1, keepdims=True)
    n = len(steps)
    return Plan(
        q=np.repeat(q, n, axis=0),
        wrench=np.repeat(direction, n, axis=0) * np.tile(steps, poses)[:, None],
        pose=np.repeat(np.arange(poses), n),
        step=np.tile(np.arange(n), poses),
        time=60.0 * np.arange(poses * n),
    )


Effect = Callable[[Plan], Array]


def campaign(what: Plan, *effects: Effect, seed: int = 0, noise: float = 1.0, **more: object) -> Measurements:
    """Return displacements with effects and noise; `noise` times that which the table states."""
    moved = what.elastic + sum(effect(what) for effect in effects)
    error = np.random.default_rng(1000 + seed).standard_normal(moved.shape)
    columns = {
        "displacement": moved + noise * error * np.repeat([POSITION, ROTATION], 3),
        "sigma_position": POSITION,
        "sigma_rotation": ROTATION,
        "pose": what.pose,
        "step": what.step,
        "time": what.time,
        "source": "campaign",
    }
    return rows_of(kr240(), what.q, what.wrench, **(columns | more))


# effects: what each adds, (N, 6)


def link_bending(what: Plan, EI: float = 6e6) -> Array:
    """Link 2 bends, softer towards its end, by Mohr's integrals over many slices."""
    arm, slices = what.arm, 50
    start, end = arm.point[:, 1], arm.point[:, 2]
    length = np.linalg.norm(end - start, axis=1)[0]
    along, total = (end - start) / length, np.zeros((len(what.q), 6))
    for s in (np.arange(slices) + 0.5) / slices:
        lever = arm.tip - (start + s * (end - start))
        moment = what.wrench[:, 3:] + np.cross(lever, what.wrench[:, :3])
        twist = along * (along * moment).sum(axis=1, keepdims=True)
        turned = length / slices * ((moment - twist) / EI + 1.3 * twist / EI) / (1.2 - 0.4 * s)
        total += np.concatenate([np.cross(turned, lever), turned], axis=1)
    return total


def bearing_tilt(what: Plan, joint: int = 2, compliance: float = 4e-7) -> Array:
    axis, moment = what.arm.axis[:, joint], what.arm.moment(what.wrench)[:, joint]
    across = moment - axis * (axis * moment).sum(axis=1, keepdims=True)
    return what.arm.turned(compliance * across, joint)


def bearing_play(what: Plan, joint: int = 2, half: float = 1.5e-4) -> Array:
    """A bearing tips over from one end of its play to the other, whatever the size of its moment."""
    axis, moment = what.arm.axis[:, joint], what.arm.moment(what.wrench)[:, joint]
    across = moment - axis * (axis * moment).sum(axis=1, keepdims=True)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    return what.arm.turned(half * across / size * np.minimum(size / 100.0, 1.0), joint)


def one_sided_drive(what: Plan, joint: int = 1, softer: float = 8e-8) -> Array:
    """A drive gives more under torque of one sign than of the other: the library has no name for that."""
    return what.arm.slipped(softer * np.maximum(what.arm.torque(what.wrench)[:, joint], 0.0), joint)


def base_compliance(what: Plan, compliance: float = 2e-7) -> Array:
    """A pedestal tilts about a point 0.2 m below the floor."""
    lever = what.arm.tip - [0.0, 0.0, -0.2]
    turned = compliance * (what.wrench[:, 3:] + np.cross(lever, what.wrench[:, :3])) * [1.2, 0.9, 0.1]
    return np.concatenate([np.cross(turned, lever), turned], axis=1)


def tool_compliance(what: Plan, compliance: float = 4e-6) -> Array:
    """A gripper's mounting turns, softer about one axis of the tool."""
    tool = what.arm.tool
    own = np.einsum("nab,na->nb", tool, what.wrench[:, 3:]) * [1.3, 0.8, 0.6]
    turned = compliance * np.einsum("nab,nb->na", tool, own)
    return np.concatenate([0.5 / 50 * compliance * what.wrench[:, :3], turned], axis=1)


def backlash(what: Plan, joint: int = 2, half: float = 3e-4) -> Array:
    return what.arm.slipped(half * np.sign(what.torque[:, joint]), joint)


def hardening(what: Plan, joint: int = 1) -> Array:
    """A drive that is soft by 1.8 up to a fifth of its largest torque."""
    torque = what.torque[:, joint]
    knee = 0.2 * np.abs(torque).max()
    return what.arm.slipped(0.8 * compliances()[joint] * np.clip(torque, -knee, knee), joint)


def hysteresis(what: Plan, joint: int = 2, share: float = 0.25) -> Array:
    """Dry friction holds the drive where it is until the torque has moved on by more than the friction."""
    torque = what.torque[:, joint]
    friction, wound = share * np.abs(torque).max(), np.zeros(len(torque))
    for row in range(len(torque)):
        before = wound[row - 1] if what.step[row] else 0.0
        wound[row] = np.clip(before, torque[row] - friction, torque[row] + friction)
    return what.arm.slipped(compliances()[joint] * (wound - torque), joint)


def joint_coupling(what: Plan, share: float = 0.35) -> Array:
    c = compliances()
    slips = np.zeros((len(what.q), 6))
    slips[:, 4], slips[:, 5] = what.torque[:, 5], what.torque[:, 4]
    return sum_of(what.arm, share * np.sqrt(c[4] * c[5]) * slips)


def actuator_lever(what: Plan, joint: int = 1) -> Array:
    """A ball screw between points 0.3 and 0.9 m from the second axis drives it."""
    angle = what.q[:, joint] + 0.35
    lever = 0.3 * 0.9 * np.sin(angle) / np.sqrt(0.3**2 + 0.9**2 - 2 * 0.3 * 0.9 * np.cos(angle))
    follows = lever.max() ** 2 / lever**2
    return what.arm.slipped(compliances()[joint] * (follows - 1) * what.torque[:, joint], joint)


def load_error(what: Plan, degrees: float = 3.0) -> Array:
    """The cable pulls askew, always to the same side."""
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, -0.8, 0.0]))
    wrench = np.concatenate([turn.apply(what.wrench[:, some]) for some in (slice(3), slice(3, 6))], axis=1)
    return replace(what, wrench=wrench).elastic - what.elastic


def tool_offset(what: Plan, offset: float = 0.06) -> Array:
    """The load acts beside the tool point."""
    wrench = what.wrench.copy()
    wrench[:, 3:] += np.cross(offset * what.arm.tool[:, :, 0], wrench[:, :3])
    return replace(what, wrench=wrench).elastic - what.elastic


def frame_misalignment(what: Plan, degrees: float = 2.5) -> Array:
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array([0.3, 0.5, 0.8]))
    d, r = np.split(what.elastic, 2, axis=1)
    return np.concatenate([turn.apply(d), turn.apply(r)], axis=1) - what.elastic


def thermal_drift(what: Plan, whole: float = 3e-4) -> Array:
    share = what.time / what.time.max()
    return np.concatenate([whole * share[:, None] * [0.5, -0.3, 0.8], np.zeros((len(share), 3))], axis=1)


def outliers(what: Plan, size: float = 1.5e-3) -> Array:
    """Three rows are wrong."""
    result = np.zeros((len(what.q), 6))
    result[[7, 30, 51], [0, 2, 1]] = size
    return result


@cache
def diagnosed(name: str | None) -> Diagnosis:
    """Return the diagnosis of the usual campaign with an effect of this module, or none."""
    effects = [] if name is None else [globals()[name]]
    return diagnose(kr240(), campaign(plan(), *effects))
