"""What is worth knowing of a corrected path, in sentences."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from beamstiff.compensation.follow import external_axes
from beamstiff.compensation.formats import Program
from beamstiff.compensation.learn import Learned
from beamstiff.compensation.machine import VISIBLE, Machine
from beamstiff.compensation.path import StatedFrame
from beamstiff.compensation.path_correction import Correction
from beamstiff.compensation.posture import arm_of
from beamstiff.compensation.rewrite import Compensated, size_of
from beamstiff.compensation.uncertainty import correlated_effects, from_start_values
from beamstiff.diagnosis.effects.approach_direction import approach_of
from beamstiff.diagnosis.inference.library import REVERSED
from beamstiff.diagnosis.recalibration import ALIKE
from beamstiff.errors import listed
from beamstiff.functions.checks import effects_text, shown_value
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.plausibility import robot_doubts
from beamstiff.robot.stiffness_parameters import missing_stiffness
from beamstiff.units import in_unit

ALONG = "tare_along_the_load"  # of a load that is not as stated: what does not grow with it


def compensation_notes(
    result: Compensated, program: Program, given: Mapping[str, bool], branch: bool, taught: bool
) -> list[str]:
    """Return what is worth knowing, where frames are `given` and the `branch` is chosen or not."""
    machine, learned = result.machine, result.learned
    return [
        *robot_doubts(machine.controller),
        *([] if taught else _unproven(result, machine)),
        *_from_start_values(result, taught),
        *program.notes,
        *_one_robot_for_both(machine),
        *_given_frames(program, machine, given),
        *_where_from(result),
        *_unseen_tip(machine),
        *_assumed_frames(program, machine, given),
        *_unfollowed_postures(result, branch),
        *_where_it_begins(result, branch),
        *_where_joints_stand(result),
        *_unknown_sides(result),
        *_jumps(result.correction),
        *([] if learned is None else _learned_said(learned)),
        *_left_out(result),
        *_of_the_robot(result),
    ]


def _one_robot_for_both(machine: Machine) -> Iterator[str]:
    """Yield what is lost where controller and real robot hardly differ."""
    if machine.actual is None and machine.controller.calibrated:
        yield (
            f"robot {machine.controller.name!r} is calibrated and serves as the controller's robot too: its "
            f"geometry errors stay uncorrected. Unless the controller has this geometry, name the nominal "
            f"robot first and this one with --actual"
        )
    if missing_stiffness(machine.real) and not machine.real.effects:
        what = "differ in geometry alone" if machine.actual is not None else "are one and the same"
        yield (
            f"robot {machine.real.name!r} is rigid: weight and load move nothing, so that controller and "
            f"real robot {what}; give it a stiffness, or the real robot as `actual`"
        )


def _given_frames(program: Program, machine: Machine, given: Mapping[str, bool]) -> Iterator[str]:
    """Yield whose base and tool count, where the program states some."""
    for what in ("base", "tool"):
        stated = _stated(program, what)
        if stated and given[what]:
            yield f"{what} is the given one, not {stated[0].name} of the program"
        elif used := dict.fromkeys(
            one.name for one in stated if one.pose is not None and not np.array_equal(one.pose, np.eye(4))
        ):
            yield f"{what} is that of the program: {listed(used, 4)}"
        elif stated and what == "tool":
            yield (
                f"the tool of the program is zero: its targets count for node {machine.controller.tcp!r} of "
                "the robot file; if the controller's flange is elsewhere, give its tool (--tool)"
            )


def _assumed_frames(program: Program, machine: Machine, given: Mapping[str, bool]) -> Iterator[str]:
    """Yield which frames count where neither the program nor the user states any."""
    if silent := [what for what in ("base", "tool") if not given[what] and not _stated(program, what)]:
        frames = {"base": "the base frame", "tool": f"node {machine.controller.tcp!r}"}
        taken = " and ".join(frames[what] for what in silent)
        yield (
            f"the program names no {' and no '.join(silent)}: {taken} of the robot file "
            f"{'count' if len(silent) > 1 else 'counts'} (--{', --'.join(silent)})"
        )


def _unfollowed_postures(result: Compensated, branch: bool) -> Iterator[str]:
    """Yield why the postures that a program states are not followed."""
    machine = result.machine
    postures = [one.text for one in result.correction.path.stated_postures if one is not None]
    if postures and branch:
        yield f"q chooses the posture: {postures[0]} and the like in the program are not followed"
    elif postures and arm_of(machine.kinematics) is None:
        yield (
            f"{postures[0]} and the like in the program are not followed: robot "
            f"{machine.controller.name!r} is no arm of six joints with a spherical wrist"
        )


def _where_it_begins(result: Compensated, branch: bool) -> Iterator[str]:
    """Yield at which joint values the path begins, where nobody chose them."""
    found, robot = result.correction, result.machine.controller
    if branch or not found.corrected.any():  # of a refused target no posture is its own
        return
    first = int(np.argmax(found.corrected))
    values = zip(robot.actuated, found.q[first].round(6).tolist(), strict=True)
    joints = (f"{one.name} = {shown_value(robot, one.name, value + 0.0)}" for one, value in values)
    begins = (
        "the path begins"
        if first == 0
        else f"the first target that is reached, {found.path.place(first)}, is"
    )
    yield f"{begins} at {', '.join(joints)}; --q chooses another posture"


def _jumps(found: Correction) -> Iterator[str]:
    """Yield where the joints jump to another configuration."""
    if found.switched.size:
        lines = listed([found.path.line(row) for row in found.switched.tolist()])
        yield (
            f"the joints must jump to another configuration before line {lines}. If the robot itself makes "
            "no such jump, the program's base or tool is another (--base, --tool)"
        )


def _learned_said(learned: Learned) -> Iterator[str]:
    """Yield what a measured run tells, and whether another would help."""
    if effects := effects_text(learned.effects):
        yield f"the run shows {effects} besides the process; added to the robot"
    if names := [one.name for one in learned.parameters if not one.identifiable]:
        yield f"the run does not identify {listed(names)}, which stay near their expected values"
    if not learned.pays:
        yield (
            f"another correction would not help: the run was {1e3 * learned.before:.3f} mm (RMS) from "
            f"its targets, of which {1e3 * learned.unexplained:.3f} mm are not explained"
        )


def _left_out(result: Compensated) -> Iterator[str]:
    """Yield which targets are not corrected, or not exactly, and which effects are not."""
    found, machine = result.correction, result.machine
    if partly := {row: left for row, left in found.partly.items() if row not in found.reasons}:
        names = [found.path.called(row) for row in partly]
        left = size_of(np.array([*partly.values()]))
        yield (
            f"no command is exact for {len(names)} of {len(found.path)} targets, because the real robot "
            f"jumps there: at most {left.max_mm:.3g} mm and {left.max_deg:.3g} deg remain: {listed(names, 5)}"
        )
    if result.left_alone:
        names = [found.path.called(row) for row in result.left_alone]
        yield (
            f"{len(names)} of {len(found.path)} targets stay as they are, because their correction is below "
            f"twice its standard deviation: {listed(names, 5)}"
        )
    if machine.set_aside:
        ignored = (
            f"{effects_text(machine.set_aside)} is taken for an error of the measurement and not corrected"
        )
        drifts = any(one.effect == "thermal-drift" for one in machine.set_aside)
        robot = "; if the robot drifts and not the tracker, calibrate it warm" if drifts else ""
        yield ignored + _true_loads(machine) + robot


def _of_the_robot(result: Compensated) -> Iterator[str]:
    """Yield which effects and which model of the real robot the correction includes."""
    real = result.machine.real
    if result.std is not None and (apart := correlated_effects(real.effects)):
        yield (
            f"the standard deviations of the corrections leave out {effects_text(apart)}: its parameters "
            "were fitted together, and the robot file does not hold their correlation"
        )
    if real.model is not None:
        yield (
            f"the displacement follows the robot's model ({real.model.kind}), fitted to {real.model.source}"
        )
    if real.effects:
        yield f"the robot's effects are included: {effects_text(real.effects)}"


def _where_joints_stand(result: Compensated) -> Iterator[str]:
    """Yield which joints stand where the path says, and which of its axes no joint of the robot is."""
    path, every = result.correction.path, [one.name for one in result.machine.controller.actuated]
    held = external_axes(result.machine.kinematics, path)
    followed = [every[at] for at in np.flatnonzero(~np.isnan(held).all(axis=0))]
    if followed:
        yield f"{listed(followed)}: external axis, held where the path says"
    moved = {name: np.flatnonzero(np.nan_to_num(values)) for name, values in path.external.items()}
    known = {name.casefold() for name in followed}
    lost = {name: rows[0] for name, rows in moved.items() if rows.size and name.casefold() not in known}
    if lost:
        yield (
            f"external axes are not followed: {listed(lost)}, first in line {path.line(min(lost.values()))}. "
            "They are, if joints of the robot file beside six others have these names"
        )


def _unknown_sides(result: Compensated) -> Iterator[str]:
    """Yield where nobody knows from which side joints with lost motion come, and what that may change."""
    machine, found = result.machine, result.correction
    rows = np.flatnonzero(~np.isnan(found.before[:, 0]))
    every = [one.name for one in machine.controller.actuated]
    for effect in machine.real.effects:
        if effect.effect != REVERSED or not rows.size:
            continue
        own = [effect.component] if effect.component in every else every
        q, at = found.q_before[rows], [every.index(name) for name in own]
        known = approach_of(q)
        unknown = (known[:, at] == 0.0).any(axis=1)
        if not unknown.any():
            continue
        sides = known.copy()
        sides[:, at] = np.where(known[:, at] == 0.0, 1.0, known[:, at])
        near, still = machine.undeformed(q), np.zeros((len(q), 6))
        apart = machine.moved(q, still, near, sides) - machine.moved(q, still, near, known)
        most = 1e3 * np.linalg.norm(apart[unknown, :3], axis=1).max()
        names = [found.path.called(row) for row in rows[unknown].tolist()]
        which = "all targets" if len(names) == len(found.path) else listed(names, 5)
        yield (
            f"{which}: the path does not say from which side {listed(own)} comes, so its lost motion is not "
            f"corrected there: up to {most:.2g} mm either way. Put a row before them that arrives as the "
            "robot will"
        )


def _stated(program: Program, what: str) -> list[StatedFrame]:
    """Return the bases or tools that a program states for its targets."""
    return [one for place in program.places if (one := getattr(place, what)) is not None]


def _unseen_tip(machine: Machine) -> list[str]:
    """Return that the tool itself was not measured, where a calibration read other points only."""
    real = machine.real
    read = {name for one in real.calibrated if (name := one.name.removesuffix(".x")) != one.name} - {"base"}
    if not read or read & {"target", real.tcp}:
        return []
    moved = _moved_alike(machine, sorted(read))
    off = f" (these stand {1e3 * moved:.2g} mm elsewhere, alike: the tool may too)" if moved else ""
    return [
        f"{real.tcp!r} was not measured, only {listed(sorted(read), 3)}{off}: its place on its link and the "
        "zero of the last joint are as in the robot file. Check them with a reflector in the tool"
    ]


def _moved_alike(machine: Machine, points: Sequence[str]) -> float:
    """Return how far points stand alike elsewhere from the tool than in the controller's robot, m; or 0."""
    if machine.measured is None or len(points) < 2:
        return 0.0
    seen = []
    for robot in (machine.controller, machine.real):
        kinematics = compile_kinematics(robot)
        where = posture(kinematics, machine.measured[None])
        tool, *others = (pose_of(kinematics, where, name)[0] for name in (robot.tcp, *points))
        seen.append(np.stack([tool[:3, :3].T @ (one[:3, 3] - tool[:3, 3]) for one in others]))
    moved = seen[1] - seen[0]
    mean = float(np.linalg.norm(moved.mean(axis=0)))
    return mean if np.linalg.norm(moved - moved[0], axis=1).max() < ALIKE * mean else 0.0


def _where_from(result: Compensated) -> list[str]:
    """Return where the errors count from, where that decides how large they are."""
    taught = result.correction.taught_base
    if taught is None or not np.array_equal(result.machine.frames.base, np.eye(4)):
        return []
    far, turned = 1e3 * np.linalg.norm(taught.moved[:3]), np.degrees(np.linalg.norm(taught.moved[3:]))
    return [
        "the program counts from the robot's own base frame: at the points of --base-taught the tool touched "
        f"the workpiece, which stands {far:.2g} mm (at the first point) and {turned:.2g} deg from where the "
        "controller has it, and the targets with it"
    ]


def _true_loads(machine: Machine) -> str:
    """Return, in words, which loads to state where those of the measured rows were wrong."""
    parts = [part for one in machine.set_aside if one.effect == "load-error" for part in one.each]
    if not parts:
        return ""
    sizes = {name: value for part in parts for name, value in part.parameters.items()}
    if "gain" not in sizes or sizes.keys() - {"gain", ALONG}:
        return "; state the load that really acts"
    std = parts[0].std.get("gain")
    spread = "" if std is None or ALONG in sizes else f" ± {in_unit(std, '1'):.2g}"
    acts = f"{1.0 + in_unit(sizes['gain'], '1'):.3g}{spread} N for each N in the measured table"
    tare = f", and {in_unit(sizes[ALONG], 'N'):+.3g} N" if ALONG in sizes else ""
    return f"; state the load that really acts: {acts}{tare}"


def _unproven(result: Compensated, machine: Machine) -> list[str]:
    """Return what effects do to the unloaded robot: displacements that they were found from do not fix it."""
    said = []
    for effect, parts in machine.unproven(result.correction.q[result.known]).items():
        source = {one.found_from for one in machine.real.effects if one.label == effect}
        if source == {"positions"}:  # which show the unloaded tool itself
            continue
        why = "displacements, loaded minus unloaded, cannot confirm that part, absolute positions can"
        if None in source:
            why = f"its file does not say from which readings it was found; {why}"
        shown = ", ".join(f"{name} {1e3 * size:.2g} mm" for name, size in parts.items())
        said.append(
            f"part of the correction assumes that {effect} moves the unloaded tool too ({shown}): {why}; "
            "check a target, or teach the targets and correct only what the load does (--taught)"
        )
    return said


def _from_start_values(result: Compensated, taught: bool) -> list[str]:
    """Return how much of the predicted error comes from stiffness that no measurement determined."""
    found, machine = result.correction, result.machine
    rows = np.flatnonzero(result.known & found.corrected)
    if not (rows.size and machine.real.unmeasured):
        return []
    q, wrench, tip = found.q[rows], found.wrench[rows], found.targets[rows]
    moved = from_start_values(machine, q, wrench, tip, found.taught_base)
    if taught:  # then the weight is in the targets
        moved -= from_start_values(machine, q, np.zeros_like(wrench), tip)
    size = np.linalg.norm(moved[:, :3], axis=1)
    most = int(np.argmax(size))
    if size[most] < VISIBLE:
        return []
    where = found.path.called(int(rows[most]))
    return [
        f"up to {1e3 * size[most]:.2g} mm of the predicted error (at {where}) comes "
        f"from start values: no measurement determined {listed(machine.real.unmeasured, 6)} of robot "
        f"{machine.real.name!r}; measure under loads that twist these joints and identify them"
    ]
