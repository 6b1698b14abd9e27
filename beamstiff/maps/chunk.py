"""One chunk of a map: the quantities at every pose that has them, and why the others have not."""

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.fem.condensation import condense, tcp_stiffness
from beamstiff.maps.grid import Box
from beamstiff.maps.job import Job
from beamstiff.maps.quantities import MEANING, QUANTITIES, Reason, from_compliance, from_jacobian
from beamstiff.maps.reach import outside_limits
from beamstiff.model.correction import compliance_correction
from beamstiff.robot.closure import close_loops
from beamstiff.robot.kinematics import Posture, posture_at
from beamstiff.se3 import Array

Mask = NDArray[np.bool_]

BLOCK = 4096  # poses at a time: what belongs to them stays in the processor's cache
_POSE = re.compile(r",? ?(at|\() ?pose \d+\)?")


@dataclass(frozen=True, eq=False)
class Part:
    """What a chunk gives."""

    # (P, ...): by quantity; NaN where a pose has none. ``q`` (P, A) where joint values were found
    values: dict[str, Array]
    reasons: NDArray[np.int8]  # (P,) int8
    examples: dict[int, str]  # by reason, what was said of one such pose


def compute_chunk(job: Job, box: Box) -> Part:
    """Return one chunk of a job."""
    points = job.grid.points(box)
    blocks = [compute_poses(job, some) for some in np.array_split(points, -(-len(points) // BLOCK))]
    examples: dict[int, str] = {}
    for block in blocks:
        examples = block.examples | examples
    return Part(
        {name: np.concatenate([block.values[name] for block in blocks]) for name in blocks[0].values},
        np.concatenate([block.reasons for block in blocks]),
        examples,
    )


def compute_poses(job: Job, points: Array) -> Part:
    """Return the quantities at points (P, D) of a job's grid."""
    try:
        with np.errstate(over="raise"):
            return _computed(job, points)
    except FloatingPointError as error:
        raise BeamstiffError(
            f"the map: numbers out of range ({error}), expected lengths, loads and stiffness of a real "
            "machine; check their units"
        ) from None


def _computed(job: Job, points: Array) -> Part:
    robot, kinematics = job.robot, job.structure.kinematics
    values: dict[str, Array] = {}
    examples: dict[int, str] = {}
    if job.grid.target is None:
        q = job.grid.joint_values(points, robot)
        reasons = np.where(outside_limits(robot.actuated, q), Reason.LIMITS, Reason.COMPUTED).astype(np.int8)
    else:
        q, reasons = job.reach.solve(job.grid.targets(points))
        if (others := np.flatnonzero(reasons == Reason.OTHER_CONFIGURATION)).size:
            examples[Reason.OTHER_CONFIGURATION] = _other(job, q[others[0]])
        values["q"] = np.where((reasons == Reason.COMPUTED)[:, None], q, np.nan)
    there = np.flatnonzero(reasons == Reason.COMPUTED)
    closure = close_loops(kinematics, q[there], strict=False)
    wrong = np.where(closure.closed, Reason.COMPUTED, Reason.LOOP_OPEN).astype(np.int8)
    declared = {variable.name: variable for variable in robot.variables}
    variables = [declared[name] for name in kinematics.coupling.names]
    wrong[outside_limits(variables, closure.values)] = Reason.LIMITS  # passive and coupled ones too
    reasons[there] = wrong
    if (opened := np.flatnonzero(wrong == Reason.LOOP_OPEN)).size:
        examples[Reason.LOOP_OPEN] = _without_number(closure.reasons[opened[0]])
    for name in job.quantities:
        values[name] = np.full((len(points), *map(len, QUANTITIES[name].components)), np.nan)
    good = wrong == Reason.COMPUTED
    there = there[good]
    if there.size:
        posture = posture_at(kinematics, closure.values[good])
        for reason, failed, message in _fill(job, posture, values, there):
            some = there[failed]
            reasons[some[reasons[some] == Reason.COMPUTED]] = reason
            examples.setdefault(reason, _without_number(message))
    if "q" in values:
        values["q"][reasons == Reason.LIMITS] = np.nan
    for reason in np.unique(reasons):
        if reason != Reason.COMPUTED:
            examples.setdefault(int(reason), MEANING[Reason(reason)])
    return Part(values, reasons, examples)


def _fill(
    job: Job, posture: Posture, values: dict[str, Array], there: NDArray[np.intp]
) -> list[tuple[Reason, Mask, str]]:
    """Put the quantities where they belong; return which poses have none, and why."""
    faults: list[tuple[Reason, Mask, str]] = []
    poses = there.size
    if job.needs("compliance") or job.needs("weight"):
        condensed, failed, message = _where_it_works(
            lambda some: _compliance(job, posture.only(some)), poses, (6, 7)
        )
        faults.append((Reason.MECHANISM, failed, message))
        fine = np.flatnonzero(~failed)
        compliance, sag = condensed[fine, :, :6], condensed[fine, :, 6]
        displacement = compliance @ job.wrench + (sag if job.gravity else 0.0)
        for name in job.quantities:
            if name == "sag":
                values[name][there[fine]] = np.linalg.norm(sag[:, :3], axis=1)
            elif name == "stiffness_matrix":
                found, rigid, message = _where_it_works(
                    lambda some: tcp_stiffness(compliance[some], f"robot {job.robot.name!r}"),
                    len(fine),
                    (6, 6),
                )
                values[name][there[fine]] = found
                faults.append((Reason.RIGID, _at(fine, rigid, poses), message))
            elif "compliance" in QUANTITIES[name].needs:
                found = from_compliance(name, compliance, displacement, job.direction)
                rigid = np.asarray(np.isinf(found).any(axis=tuple(range(1, found.ndim))))
                found[rigid] = np.nan
                values[name][there[fine]] = found
                faults.append((Reason.RIGID, _at(fine, rigid, poses), MEANING[Reason.RIGID]))
    if job.needs("jacobian"):
        from beamstiff.planning.dexterity import normalised_jacobian  # loads an optimiser

        assert job.length is not None
        kinematics, length = job.structure.kinematics, job.length
        jacobian, failed, message = _where_it_works(
            lambda some: normalised_jacobian(kinematics, posture.only(some), length),
            poses,
            (6, len(job.robot.actuated)),
        )
        faults.append((Reason.SINGULAR, failed, message))
        for name in job.quantities:
            if "jacobian" in QUANTITIES[name].needs:
                values[name][there[~failed]] = from_jacobian(name, jacobian[~failed])
    return [fault for fault in faults if fault[1].any()]


def _compliance(job: Job, posture: Posture) -> Array:
    """Return the compliance at the TCP and its displacement by dead weight, (P, 6, 7)."""
    weight = job.needs("weight")
    condensed = condense(job.structure, posture, [job.robot.tcp], dead=weight)
    sag = condensed.clamped_dead if weight else np.zeros(condensed.clamped.shape[:2])
    both = np.concatenate([condensed.clamped, sag[:, :, None]], axis=2)
    if job.robot.model is not None:
        both += compliance_correction(job.structure, posture)
    return both


def _where_it_works(
    work: Callable[[NDArray[np.intp]], Array], poses: int, shape: tuple[int, ...]
) -> tuple[Array, Mask, str]:
    """Return what work gives at each pose (P, ...), halving what it refuses, where nothing, and why."""
    result, failed, message = np.full((poses, *shape), np.nan), np.zeros(poses, dtype=np.bool_), ""
    todo = [np.arange(poses)] if poses else []
    while todo:
        some = todo.pop()
        try:
            result[some] = work(some)
        except BeamstiffError as error:
            if some.size > 1:
                todo += np.array_split(some, 2)
            else:
                failed[some], message = True, str(error)
    return result, failed, message


def _other(job: Job, q: Array) -> str:
    """Say in which configuration a pose is reached, in the way that a command takes it."""
    parts = []
    for variable, value in zip(job.robot.actuated, q.tolist(), strict=True):
        angle = f"{round(np.degrees(value), 1) + 0.0:g}deg"
        parts.append(f"{variable.name}={angle if variable.kind == 'angle' else f'{value:.4g}'}")
    return f"{MEANING[Reason.OTHER_CONFIGURATION]}, such as {','.join(parts)}"


def _at(places: NDArray[np.intp], mask: Mask, count: int) -> Mask:
    result = np.zeros(count, dtype=np.bool_)
    result[places[mask]] = True
    return result


def _without_number(message: str) -> str:
    """Return a message without the number of the pose, which is that in its block."""
    return _POSE.sub("", message)
