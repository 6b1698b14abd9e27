"""The model as it is, fitted to the data: its residual, and what it could absorb.

The forward model holds everything that is known: closed loops, beams, payload, gravity, and the stiffness of
the loaded machine (K_C). Its stiffness values (`identify:`) are fitted first; the diagnosis looks at what
remains, and only at what these values cannot absorb.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from beamstiff.calibration.elastic import realistic_compliances
from beamstiff.diagnosis.residual.internal_wrench import Places, find_places
from beamstiff.identification.minimise import minimise
from beamstiff.identification.objective import Objective
from beamstiff.identification.parameters import Parameters, build_parameters
from beamstiff.identification.problem import Problem
from beamstiff.identification.whitening import whitening
from beamstiff.measure.arrays import Integers
from beamstiff.measure.table import Measurements
from beamstiff.model.correction import model_correction
from beamstiff.model.linear import compliance_of_rows, displaced_points, predict_displacements
from beamstiff.model.ports import PortModel, reduce_to_ports
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation

ROUNDS = 3  # of fitting and correcting for the loaded machine
ROUNDING = 1e-9  # share of its like, below which a quantity is nothing but rounding
POSITION_NOISE, ROTATION_NOISE = 3e-5, 5e-5  # m, rad: where a table says none, to begin with
KNOWN_FACTOR = 1e4  # a fitted stiffness stays near its start unless the data say otherwise, by this factor


@dataclass(frozen=True)
class Baseline:
    """The fitted model, its residual and its tangent; N rows, t fitted values.

    `robot`: with the fitted stiffness.
    `nominal`: as it was given.
    `measured`: (N, 6) array, m and rad; displacement, or for absolute rows the deviation from the nominal
        pose, ``[d, r]``, base frame; where a row is read along axes of its own (`Measurements.along`), this
        and all beside it along these.
    `used`: (N, 6) bool array.
    `sigma`: (N, 6) array; standard deviations by which the components count.
    `claimed`: whether the table states them.
    `sharing`: (N,) int array; rows with one unloaded reading; -1 none.
    `predicted`: (N, 6) array.
    `tangent`: (N, 6, t) array; derivatives by the compliances.
    `response`: (N, 6, 6) array; displacement of the row's point per unit wrench at its load point, linear.
    `realistic`: (t,) array; compliances that move a point by about 1 mm where they move it most.
    `fit_rows`: the baseline that was fitted, where this one is its prediction for other rows.
    `given`: as its file describes it, where `nominal` is calibrated already.
    `stated`: normalisation of an effect that the robot has, in place of those of the rows that were fitted.
    """

    robot: Robot
    nominal: Robot
    rows: Measurements
    fitted: tuple[str, ...]
    measured: Array
    used: NDArray[np.bool_]
    sigma: Array
    claimed: bool
    sharing: Integers
    predicted: Array
    tangent: Array
    response: Array
    places: Places
    realistic: Array
    fit_rows: Baseline | None = None
    given: Robot | None = None
    stated: Mapping[str, float | tuple[float, ...]] | None = None

    @property
    def fit(self) -> Baseline:
        """The baseline that was fitted: effects are scaled by its rows."""
        return self.fit_rows or self

    @property
    def absolute(self) -> bool:
        """Whether the rows are absolute positions."""
        return self.rows.kind == "absolute"

    @cached_property
    def described(self) -> tuple[Array, Array]:
        """Where the robot as it was given has the rows' points, (N, 3), and the TCP's rotation, (N, 3, 3)."""
        return nominal_pose(self.nominal, self.rows)

    @cached_property
    def pose_changes(self) -> dict[str, Array]:
        """How the nominal pose changes with parameters of the geometry, (N, 6) each, as far as known yet."""
        return {}

    @cached_property
    def joint_values(self) -> dict[str, Array]:
        """Every variable in every row, (N,) each: actuated ones as read, others with the loops closed."""
        kinematics = compile_kinematics(self.nominal)
        poses, number = np.unique(self.rows.q, axis=0, return_inverse=True)
        values = posture(kinematics, poses).values[number.reshape(-1)]
        return dict(zip(kinematics.coupling.names, values.T, strict=True))

    @property
    def gap(self) -> Array:
        """Measured less predicted, (N, 6); 0 where not measured."""
        return np.where(self.used, self.measured - self.predicted, 0.0)


def fitted_names(robot: Robot) -> tuple[str, ...]:
    """Return what is fitted: the robot's `identify`, or its joints' finite stiffness, own directions.

    Nothing beside a fitted `model`: the gap is then that model's.
    """
    if robot.model is not None:
        return ()
    if robot.identify:
        return robot.identify
    values = stiffness_parameters(robot)
    names = [f"{joint.name}.{own_direction(robot, joint.name)}" for joint in robot.joints]
    return tuple(name for name in names if 0.0 < values[name] < RIGID)


def own_direction(robot: Robot, joint: str) -> str:
    """Return the direction of the stiffness about, or along, the axis that a joint moves on."""
    own = next(item for item in robot.joints if item.name == joint)
    variable = next((item for item in robot.variables if item.name == own.variable), None)
    return "axial" if variable is not None and variable.kind == "length" else "torsional"


def fit_baseline(
    robot: Robot, rows: Measurements, sigma: Array | None = None, keep: Sequence[str] | None = None
) -> Baseline:
    """Fit the model to the data.

    `rows`: displacements or absolute poses.
    `sigma`: (N, 6) array; standard deviations instead of those stated.
    `keep`: parameters to fit instead of `fitted_names`.
    Raises BeamstiffError when the rows cannot be predicted: loops that do not close, a mechanism.
    """
    names = fitted_names(robot) if keep is None else tuple(keep)
    measured, used = deviation(robot, rows), rows.measured_mask
    claimed = bool((np.isfinite(rows.sigma) & used).any())
    spread = _sigma(rows) if sigma is None else sigma
    sharing = rows.sharing
    fitted = robot
    predicted = predict(fitted, rows)
    if names:
        model = reduce_to_ports(robot, rows, names, gravity=rows.kind == "absolute").along(rows)
        theta, stiffness = None, model.start
        for _ in range(ROUNDS):
            bent = predicted - model.predict(_values(fitted, names, model.start))
            stated, theta = _fitted(model, rows, measured - bent, used, spread, claimed, theta)
            before = stiffness
            stiffness = stated.stiffness(theta)
            fitted = robot.with_parameters(dict(zip(names, stiffness.tolist(), strict=True)))
            predicted = predict(fitted, rows)
            if np.abs(np.log(stiffness / before)).max() < 1e-3:
                break
        tangent = _by_compliance(model, stiffness)
        realistic = realistic_compliances(robot, rows, model, stiffness, rows.kind == "absolute")
    else:
        tangent, realistic = np.zeros((len(rows), 6, 0)), np.zeros(0)
    return Baseline(
        robot=fitted,
        nominal=robot,
        rows=rows,
        fitted=names,
        measured=np.where(used, measured, 0.0),
        used=used,
        sigma=spread,
        claimed=claimed,
        sharing=sharing,
        predicted=predicted,
        tangent=tangent,
        response=tool_response(fitted, rows),
        places=find_places(fitted, rows),
        realistic=realistic,
    )


def _fitted(
    model: PortModel,
    rows: Measurements,
    measured: Array,
    used: NDArray[np.bool_],
    sigma: Array,
    claimed: bool,
    begin: Array | None,
) -> tuple[Parameters, Array]:
    """Return the parameters of a linear model, and their logarithms (t,) that explain (N, 6) best."""
    problem = Problem(
        model=model,
        measured=np.where(used, measured, 0.0),
        used=used,
        sigma=sigma,
        sigma_known=claimed,
        sharing=rows.sharing,
        pose=rows.pose,
        load=rows.pose,
        whitening=whitening(sigma, used, rows.sharing),
        source=rows.source,
    )
    starts = zip(model.parameters, model.start.tolist(), strict=True)
    stated = build_parameters(
        model.parameters, model.start, priors={name: (at, KNOWN_FACTOR) for name, at in starts}
    )
    return stated, minimise(Objective(problem, stated), begin=begin).theta


def linear_fit(fit: Baseline) -> tuple[Robot, Array]:
    """Return the robot whose linear statics explains displacements best, and what it predicts, (N, 6)."""
    model = reduce_to_ports(fit.nominal, fit.rows, fit.fitted).along(fit.rows)
    stated, theta = _fitted(model, fit.rows, fit.measured, fit.used, fit.sigma, fit.claimed, None)
    stiffness = stated.stiffness(theta)
    robot = fit.nominal.with_parameters(dict(zip(fit.fitted, stiffness.tolist(), strict=True)))
    return robot, model.predict(stiffness)


def at_rows(fit: Baseline, rows: Measurements) -> Baseline:
    """Return the fitted baseline's view of other rows, measured or not."""
    predicted = predict(fit.robot, rows)
    if fit.fitted:
        model = reduce_to_ports(fit.robot, rows, fit.fitted, gravity=rows.kind == "absolute").along(rows)
        stiffness = _values(fit.robot, fit.fitted, model.start)
        tangent = _by_compliance(model, stiffness)
    else:
        tangent = np.zeros((len(rows), 6, 0))
    used = rows.measured_mask
    return replace(
        fit,
        rows=rows,
        measured=np.where(used, deviation(fit.nominal, rows), 0.0),
        used=used,
        sigma=_sigma(rows),
        sharing=rows.sharing,
        predicted=predicted,
        tangent=tangent,
        response=tool_response(fit.robot, rows),
        places=find_places(fit.robot, rows),
        fit_rows=fit.fit,
        stated=None,
    )


def _by_compliance(model: PortModel, stiffness: Array) -> Array:
    """Return the derivative of the displacements by compliances, (N, 6, t); 0 where it is but rounding.

    Of positions and rotations by themselves: a drive whose axis meets the point that is read turns it alone.
    """
    tangent: Array = -model.derivatives(stiffness)[1] * stiffness**2
    parts = tangent.reshape(len(tangent), 2, 3, -1)
    size = np.linalg.norm(parts, axis=(0, 2), keepdims=True) / stiffness
    seen = size > ROUNDING * size.max(axis=-1, initial=0.0, keepdims=True)
    return np.where(seen, parts, 0.0).reshape(tangent.shape)


def around(fit: Baseline, stiffness: Array) -> Baseline:
    """Return what is fitted, made linear about another stiffness (t,); what counts of its rows stays.

    Displacements are linear in the compliances, so that a fit is the same from anywhere; what an effect does
    depends on the stiffness of the rest.
    """
    robot = fit.nominal.with_parameters(dict(zip(fit.fitted, stiffness.tolist(), strict=True)))
    there = at_rows(replace(fit, robot=robot), fit.rows)
    result = replace(there, used=fit.used, sigma=fit.sigma, sharing=fit.sharing, fit_rows=None)
    result.pose_changes.update(fit.pose_changes)  # of the robot that carries nothing
    return result


def on_drives(fit: Baseline, stiffness: Array) -> Baseline:
    """Return what effects look at on drives of another stiffness (t,): what is predicted to first order.

    Displacements are linear in the compliances but for K_C, which `around` counts as well, far slower.
    """
    change = 1.0 / stiffness - 1.0 / _values(fit.robot, fit.fitted, stiffness)
    robot = fit.nominal.with_parameters(dict(zip(fit.fitted, stiffness.tolist(), strict=True)))
    result = replace(
        fit,
        robot=robot,
        predicted=fit.predicted + fit.tangent @ change,
        response=tool_response(robot, fit.rows),
        places=find_places(robot, fit.rows),
    )
    result.pose_changes.update(fit.pose_changes)
    return result


def tool_response(robot: Robot, rows: Measurements) -> Array:
    """Return the displacement of the rows' points per unit wrench at their load points, (N, 6, 6), linear."""
    if not any(0.0 < value < RIGID for value in stiffness_parameters(robot).values()):
        return np.zeros((len(rows), 6, 6))
    return compliance_of_rows(robot, rows)


def tcp_response(baseline: Baseline) -> Array:
    """Return the displacement of the rows' points per unit wrench at the TCP, (N, 6, 6), linear."""
    rows, tcp = baseline.rows, baseline.robot.tcp
    if (rows.load_point == tcp).all():
        return baseline.response
    return tool_response(baseline.robot, replace(rows, load_point=np.full(len(rows), tcp)))


def predict(robot: Robot, rows: Measurements) -> Array:
    """Return what a model says of the rows, (N, 6).

    Displacements are loaded less unloaded, deviations of absolute poses hold the dead weight as well; both
    with the stiffness of the loaded machine, and with the effects that the robot has.
    """
    predicted = _of_structure(robot, rows)
    if not robot.effects:
        return predicted
    from beamstiff.diagnosis.apply import effects_displacement  # which rests on baselines without effects

    return predicted + effects_displacement(robot, rows)


def _of_structure(robot: Robot, rows: Measurements) -> Array:
    if not any(0.0 < value < RIGID for value in stiffness_parameters(robot).values()):
        return np.zeros((len(rows), 6))
    if rows.kind == "displacement":
        moved = predict_displacements(robot, rows, preload=True)
    else:
        moved, _ = displaced_points(robot, rows)
    return rows.along(moved if robot.model is None else moved + model_correction(robot, rows))


def deviation(robot: Robot, rows: Measurements) -> Array:
    """Return displacements, or absolute poses less the nominal geometry's, (N, 6); NaN unknown."""
    if rows.kind == "displacement":
        return rows.displacement
    positions, rotations = nominal_pose(robot, rows)
    result = np.full((len(rows), 6), np.nan)
    result[:, :3] = rows.position - positions
    known = ~np.isnan(rows.rotation).any(axis=1)
    if known.any():
        turned = rotation_from_vector(rows.rotation[known]) @ rotations[known].swapaxes(-1, -2)
        result[known, 3:] = vector_from_rotation(turned)
    return rows.along(result) if rows.camera else result


def nominal_pose(robot: Robot, rows: Measurements, node: str | None = None) -> tuple[Array, Array]:
    """Return where the undeformed robot has the rows' points (N, 3), and the rotation of a node (N, 3, 3).

    `node`: default the TCP.
    """
    kinematics = compile_kinematics(robot)
    poses, number = np.unique(rows.q, axis=0, return_inverse=True)
    where, pose = posture(kinematics, poses), number.reshape(-1)
    seen = [kinematics.node_index[name] for name in rows.point.tolist()]
    return where.node_positions[pose, seen], pose_of(kinematics, where, node or robot.tcp)[pose, :3, :3]


def _values(robot: Robot, names: Sequence[str], start: Array) -> Array:
    known = stiffness_parameters(robot)
    values = np.array([known[name] for name in names])
    return np.where(np.isfinite(values) & (values > 0), values, start)


def _sigma(rows: Measurements) -> Array:
    usual = np.repeat([POSITION_NOISE, ROTATION_NOISE], 3)
    return np.where(np.isfinite(rows.sigma) & (rows.sigma > 0), rows.sigma, usual)
