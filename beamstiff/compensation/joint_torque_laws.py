"""Effects that move one joint by a law of its torque alone: backlash, hardening, friction.

What such an effect does to the tool is the joint's motion times a slip ``g(torque)``. The motion and the
torque are smooth in posture and load, whatever kinks the law has; the law is tabulated once.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.compensation.machine import Machine
from beamstiff.compensation.uncertainty import uncertain_effects
from beamstiff.diagnosis.apply import bare_baseline, effects_displacement
from beamstiff.diagnosis.effects.torque_laws import axis_at, component_of
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

EXACT = 2e-8  # rad or m: of a slip between two entries of its table
FOLLOWS = 1e-7  # m and rad: of the tool, by which an effect may be off its law in other postures
REFINED, FIRST = 14, 65  # rounds; entries at first
NEAR, OTHERS = 0.5, 12  # rad (m): how far other postures are; how many
WIDER = 1.5


@dataclass(frozen=True, eq=False)
class SlipLaw:
    """How far a joint slips by its torque, also of the standard deviations of its effect's parameters."""

    component: str
    alone: tuple[Robot, ...]  # the machine with this effect alone, and of each uncertain parameter's size
    torque: Array  # (K,), ascending, N m or N
    slip: Array  # (1 + S, K), rad or m

    def at(self, torque: ArrayLike) -> Array:
        """Return slips of torques."""
        return np.asarray(np.interp(np.asarray(torque), self.torque, self.slip[0]))

    def variance(self, torque: float) -> float:
        """Return the variance of the slip, as far as the effect's standard deviations say."""
        return float(sum(np.interp(torque, self.torque, one) ** 2 for one in self.slip[1:]))

    @property
    def most(self) -> float:
        """The largest slip; 1 where there is none."""
        return float(np.abs(self.slip[0]).max()) or 1.0


def slip_laws(machine: Machine, q: Array, load: Array) -> tuple[SlipLaw, ...]:
    """Return the laws that effects of the real robot follow, under loads up to (6,), from one posture."""
    real, found = machine.real, []
    joints = {component_of(real, joint) for joint in real.joints}
    keys = dict.fromkeys((one.effect, one.component) for one in real.effects if one.component in joints)
    for key in keys:
        own = tuple(one for one in real.effects if (one.effect, one.component) == key)
        alone = (real.model_copy(update={"effects": own}), *uncertain_effects(real, own))
        axis = axis_at(_seen(machine, q[None], np.zeros((1, 6))), str(key[1]))
        if axis.shift.any():
            most = float(np.abs(axis.dead[0]) + np.abs(axis.shift[0]) @ load)
            law = tabulated(machine, SlipLaw(str(key[1]), alone, np.zeros(1), np.zeros((1, 1))), q, most)
            if _followed(machine, law, q):
                found.append(law)
    return tuple(found)


def joint_motions(machine: Machine, laws: tuple[SlipLaw, ...], rows: Measurements) -> tuple[Array, Array]:
    """Return how the tool moves with every slip, (N, 6, L), and the torques that these follow, (N, L)."""
    bare = bare_baseline(machine.real, rows)
    axes = [axis_at(bare, law.component) for law in laws]
    return (
        np.stack([axis.shift for axis in axes], axis=-1),
        np.stack([axis.load + axis.dead for axis in axes], axis=-1),
    )


def tabulated(machine: Machine, law: SlipLaw, q: Array, torque: float) -> SlipLaw:
    """Return a law with its table up to a torque and beyond, finer where it bends, seen at a posture (A,)."""
    axis = axis_at(_seen(machine, q[None], np.zeros((1, 6))), law.component)
    shift, dead = axis.shift[0], float(axis.dead[0])
    way = shift / (shift @ shift)  # a wrench of unit torque

    def slips(torques: Array) -> Array:
        bare = _seen(machine, np.repeat(q[None], len(torques), axis=0), (torques - dead)[:, None] * way)
        return np.stack([effects_displacement(one, bare.rows, bare) @ way for one in law.alone], axis=-1)

    torque *= WIDER
    # spaced as sinh: laws bend near zero
    knots = torque * np.sinh(np.linspace(-8.0, 8.0, FIRST)) / np.sinh(8.0)
    values = slips(knots)
    fine = np.zeros(len(knots) - 1, dtype=np.bool_)
    for _ in range(REFINED):
        open_ = np.flatnonzero(~fine)
        if not open_.size:
            break
        middle = 0.5 * (knots[open_] + knots[open_ + 1])
        between = slips(middle)
        off = np.abs(between - 0.5 * (values[open_] + values[open_ + 1])).max(axis=1)
        fine = np.insert(fine, open_ + 1, off < EXACT)
        fine[open_ + np.arange(len(open_))] = off < EXACT
        knots, values = np.insert(knots, open_ + 1, middle), np.insert(values, open_ + 1, between, axis=0)
    return SlipLaw(law.component, law.alone, knots, np.ascontiguousarray(values.T))


def _followed(machine: Machine, law: SlipLaw, q: Array) -> bool:
    """Tell whether the effect is its law in other postures and under other loads too."""
    random = np.random.default_rng(0)
    others = q + NEAR * random.uniform(-1.0, 1.0, (OTHERS, len(q)))
    first = _seen(machine, others, np.zeros((OTHERS, 6)))
    most = float(law.torque[-1]) / WIDER
    axis = axis_at(first, law.component)
    # of both signs: a third of the table's torque at most
    push = random.uniform(-1.0, 1.0, (OTHERS, 1)) * most / 3.0 * axis.shift / (axis.shift**2).sum(1)[:, None]
    bare = _seen(machine, others, push)
    axis = axis_at(bare, law.component)
    inside = np.abs(axis.load + axis.dead) < law.torque[-1]
    by_law = law.at(axis.load + axis.dead)[:, None] * axis.shift
    off = np.abs(effects_displacement(law.alone[0], bare.rows, bare) - by_law)[inside]
    return bool(inside.any() and (off < FOLLOWS).all())


def _seen(machine: Machine, q: Array, wrench: Array) -> Baseline:
    """Return the real robot without effects under loads (N, 6) at its `tcp` node."""
    return bare_baseline(machine.real, machine.node_rows(q, wrench))
