"""Static equilibrium of an MJCF model in MuJoCo (optional extra `mujoco`), its drives held exactly.

Newton's method in the positions of the free joints. What is held has no unknown; equality constraints hold
exactly, by Lagrange multipliers in place of MuJoCo's soft ones::

    [K  G^T] [dq    ]   [f(q) + J^T w]
    [G   0 ] [lambda] = [-g(q)       ]
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array

STEP = 1e-6  # rad and m: of the differences that make the tangent stiffness
ITERATIONS = 60
CHANGES = 40  # of what is at a stop or slips
CONVERGED = 1e-11  # rad and m: of the last step
NOTHING = 1e-9  # of a constraint's derivatives: what is smaller is rounding
ROUNDING = 1e-9  # of steps that no longer become shorter
BALANCED = 1e-10  # of the largest force: a step that changes less moves only what nothing resists
LONGEST = 0.2  # rad and m: of a step, so that loops stay in their assembly


def engine() -> Any:
    """Return the module `mujoco`; an error that names the extra where it is missing."""
    try:
        import mujoco
    except ImportError:
        raise BeamstiffError("MuJoCo is not installed: pip install 'beamstiff[mujoco]'") from None
    return mujoco


class MujocoModel:
    """A compiled MJCF model and the data that MuJoCo works on."""

    def __init__(self, text: str) -> None:
        self.mujoco = engine()
        try:
            self.model = self.mujoco.MjModel.from_xml_string(text)
        except ValueError as error:
            raise BeamstiffError(f"MuJoCo refuses the model: {error}") from None
        self.data = self.mujoco.MjData(self.model)
        flags = self.mujoco.mjtDisableBit
        self.model.opt.disableflags |= (
            int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_LIMIT) | int(flags.mjDSBL_FRICTIONLOSS)
        )
        self.model.opt.jacobian = self.mujoco.mjtJacobian.mjJAC_DENSE
        self.start: Array = self.model.key_qpos[0].copy() if self.model.nkey else self.model.qpos0.copy()

    def equilibrium(
        self,
        held: Mapping[str, float],
        wrench: Array,
        site: str,
        start: Array | None = None,
        friction: bool = True,
    ) -> Array:
        """Return qpos in which the model rests under gravity and a wrench (6,) on a site, world frame.

        Joints stop at their limits, and those that rub stay where they are in `start` unless the load moves
        them: an active set, changed one state after the other until forces and positions agree.
        """
        model = self.model
        qpos = (self.start if start is None else start).copy()
        joints = [model.joint(name).id for name in held]
        qpos[model.jnt_qposadr[joints]] = list(held.values())
        self._lead_followers(qpos)
        begun = qpos.copy()
        fixed = {int(model.jnt_dofadr[joint]) for joint in joints}
        stops = self._stops(fixed)
        rubs = {
            int(dof): float(model.dof_frictionloss[dof])
            for dof in np.flatnonzero(model.dof_frictionloss)
            if friction and int(dof) not in fixed
        }
        state = dict.fromkeys([*stops, *rubs], 0.0)  # of stops: at which; of what rubs: which way it slips
        first = self._forces(qpos, wrench, site)
        for dof, width in stops.items():  # at the stop that the load pushes it to, where its spring is weak
            at = qpos[model.jnt_qposadr[model.dof_jntid[dof]]]
            weak = abs(first[dof]) > model.jnt_stiffness[model.dof_jntid[dof]] * width
            state[dof] = float(np.sign(first[dof] or at)) if weak else 0.0
        for _ in range(CHANGES):
            stuck = {dof for dof in state if (dof in stops) == bool(state[dof])}
            free = [dof for dof in range(model.nv) if dof not in fixed | stuck]
            extra = np.zeros(model.nv)
            for dof, width in stops.items():
                if state[dof]:
                    qpos[model.jnt_qposadr[model.dof_jntid[dof]]] = state[dof] * width
            for dof, limit in rubs.items():
                extra[dof] = -limit * state[dof]
            qpos = self._rest(qpos, np.array(free, dtype=np.int64), wrench, site, extra)
            forces = self._forces(qpos, wrench, site)
            changed = False
            for dof in state:
                at = qpos[model.jnt_qposadr[model.dof_jntid[dof]]]
                if dof in stops:
                    past = abs(at) > stops[dof] * (1.0 + 1e-9)
                    new = 0.0 if state[dof] * forces[dof] < 0.0 else np.sign(at) if past else state[dof]
                else:
                    back = state[dof] * (at - begun[model.jnt_qposadr[model.dof_jntid[dof]]]) < 0.0
                    slips = not state[dof] and abs(forces[dof]) > rubs[dof] * (1.0 + 1e-9)
                    new = 0.0 if back else np.sign(forces[dof]) if slips else state[dof]
                changed |= new != state[dof]
                state[dof] = float(new)
            if not changed:
                return qpos
        raise BeamstiffError(f"MuJoCo: stops and friction found no state in {CHANGES} changes")

    def _stops(self, fixed: set[int]) -> dict[int, float]:
        """Return the free joints with limits on both sides of 0, by their degree of freedom."""
        model, found = self.model, {}
        for joint in np.flatnonzero(model.jnt_limited):
            dof, (low, high) = int(model.jnt_dofadr[joint]), model.jnt_range[joint]
            if dof not in fixed and low == -high:
                found[dof] = float(high)
        return found

    def _forces(self, qpos: Array, wrench: Array, site: str) -> Array:
        """Return what acts on every degree of freedom but constraints, (nv,)."""
        mujoco, model, data = self.mujoco, self.model, self.data
        jacobian = np.zeros((6, model.nv))
        data.qpos[:], data.qvel[:] = qpos, 0.0
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], model.site(site).id)
        return np.asarray(data.qfrc_passive - data.qfrc_bias + jacobian.T @ wrench)

    def _rest(self, qpos: Array, free: NDArray[np.int64], wrench: Array, site: str, extra: Array) -> Array:
        """Return qpos where some degrees of freedom rest, by Newton's method from `qpos`."""
        model, data = self.model, self.data
        places = model.jnt_qposadr[model.dof_jntid[free]]
        qpos = qpos.copy()

        def forces(at: Array) -> Array:
            return (self._forces(at, wrench, site) + extra)[free]

        def constraints() -> tuple[Array, Array]:
            rows = data.nefc
            # the engine may reserve more rows than it fills
            matrix = data.efc_J.ravel()[: rows * model.nv].reshape(rows, model.nv)[:, free].copy()
            return matrix, np.array(data.efc_pos[:rows])

        multipliers, longest = np.zeros(0), np.inf
        for _ in range(ITERATIONS):
            residual = forces(qpos)
            G, gap = constraints()
            if multipliers.size != len(G):
                multipliers = np.zeros(len(G))
            tangent = np.empty((free.size, free.size))
            for column, place in enumerate(places):
                sides = []
                for way in (-STEP, STEP):
                    moved = qpos.copy()
                    moved[place] += way
                    sides.append(forces(moved) + constraints()[0].T @ multipliers)
                tangent[:, column] = (sides[0] - sides[1]) / (2 * STEP)
            step, multipliers = _solve(tangent, G, residual, gap)
            before, longest = longest, float(np.abs(step).max(initial=0.0))
            qpos[places] += step * min(1.0, LONGEST / max(longest, 1e-300))
            idle = np.abs(tangent @ step).max(initial=0.0) <= BALANCED * np.abs(residual).max(initial=0.0)
            idle &= np.abs(G @ step).max(initial=0.0) < CONVERGED
            if idle or longest < CONVERGED or (before < ROUNDING and longest > before / 2):
                return qpos
        raise BeamstiffError(f"MuJoCo: no equilibrium after {ITERATIONS} steps, the last moved {longest:.3g}")

    def _lead_followers(self, qpos: Array) -> None:
        """Put joints that follow others by an equality where these lead them."""
        model = self.model
        for at in np.flatnonzero(model.eq_type == int(self.mujoco.mjtEq.mjEQ_JOINT)):
            if (leader := int(model.eq_obj2id[at])) >= 0:
                one, other = (int(model.jnt_qposadr[joint]) for joint in (model.eq_obj1id[at], leader))
                moved = qpos[other] - model.qpos0[other]
                qpos[one] = model.qpos0[one] + np.polynomial.polynomial.polyval(moved, model.eq_data[at, :5])

    def at(self, values: Mapping[str, float]) -> Array:
        """Return qpos with joints at values by name, the others as in the reference posture."""
        qpos = self.start.copy()
        for name, value in values.items():
            if (joint := self.mujoco.mj_name2id(self.model, self.mujoco.mjtObj.mjOBJ_JOINT, name)) >= 0:
                qpos[self.model.jnt_qposadr[joint]] = value
        return qpos

    def site_pose(self, site: str, qpos: Array) -> tuple[Array, Array]:
        """Return position (3,) and rotation (3, 3) of a site."""
        self.data.qpos[:] = qpos
        self.mujoco.mj_fwdPosition(self.model, self.data)
        target = self.model.site(site).id
        return self.data.site_xpos[target].copy(), self.data.site_xmat[target].reshape(3, 3).copy()


def _solve(tangent: Array, G: Array, residual: Array, gap: Array) -> tuple[Array, Array]:
    """Return step and multipliers; redundant constraints, and motions that nothing resists, do no harm."""
    size = np.sqrt(np.abs(np.diag(tangent)))
    size = np.maximum(size, 1e-5 * size.max(initial=1.0))  # of free joints it is noise
    K, rows = tangent / size[:, None] / size, G / size
    scale = np.linalg.norm(rows, axis=1)
    scale = np.where(np.abs(G).max(axis=1, initial=0.0) > NOTHING, scale, np.inf)
    rows, count = rows / scale[:, None], len(rows)
    matrix = np.block([[K, -rows.T], [rows, np.zeros((count, count))]])
    solved = np.linalg.lstsq(matrix, np.concatenate([residual / size, -gap / scale]), rcond=1e-13)[0]
    return np.asarray(solved[: len(size)] / size), np.asarray(solved[len(size) :] / scale)
