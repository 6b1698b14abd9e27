"""What to do next of a diagnosis, in words."""

from __future__ import annotations

import numpy as np

from beamstiff.diagnosis.candidate import Candidate
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.torque_laws import axis_at, component_of
from beamstiff.diagnosis.inference.library import ALL_DRIVES
from beamstiff.diagnosis.next_measurement.between_causes import alike_in_positions
from beamstiff.diagnosis.next_measurement.test_plan import DECIDES
from beamstiff.diagnosis.notes import in_words, unstated_loads, weightless
from beamstiff.diagnosis.prior import key_of
from beamstiff.diagnosis.recalibration import unlike
from beamstiff.diagnosis.residual.baseline import Baseline, fitted_names
from beamstiff.diagnosis.residual.outlier_screening import SILENCE
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.errors import counted, listed
from beamstiff.measure.plausibility import LARGE_DISPLACEMENT
from beamstiff.report.calibrated_text import calibrated_away, calibrated_worse, moved_load
from beamstiff.report.diagnosis_words import (
    law_in_words,
    load_lever,
    named,
    several,
    told,
    unrealistic,
)
from beamstiff.report.verdict import rigid_drives, rigid_text, rounded, undetermined_text

TOO_FEW, NOTHING = "Too few rows to say anything", "nothing beyond noise"  # headlines
OF_THE_LOAD = ("load-error", "tool-offset", "payload-error")  # effects that a misplaced load looks like
LIKE_SAG = ("angle-curve", "geometry-error")  # effects that a weight unknown to the robot file looks like
WEIGHT = "no weight is known by which the machine sags, and such a sag follows the joint angles as well"
# what a remainder follows, and how it is varied by itself
VARIED = {
    "angle": "move {} alone through its range in small steps, unloaded",
    "position": "move {} alone through its travel in small steps, unloaded",
    "direction of approach": "move {} alone to the same values from both sides",
    "time": "return to one posture now and then, unloaded",
    "order of the rows": "return to one posture now and then, unloaded, and add a column t [s]",
    "load": "load some postures step by step, up and down again",
    "reflector": "read all reflectors in the same postures",
}
SIMULATED = 1e-6  # m, RMS: no instrument reads as finely
NO_CAUSES = "Fitted zeros, lengths and drive stiffness do not count as causes."


def action(result: Diagnosis, head: str) -> str:
    """Return what to do next of a diagnosis with a headline, a task a line: one thing, and the drives."""
    drives = "" if result.rms > LARGE_DISPLACEMENT else _drives(result)  # then the table is wrong first
    return f"{_one(result, head)}\n{drives}".strip()


def _one(result: Diagnosis, head: str) -> str:
    """Return the one thing to do next, as a sentence."""
    if head == TOO_FEW:
        return "Measure more rows; beamstiff plan chooses postures and loads."
    if result.decomposition is not None and unlike(result.decomposition):
        return "Check that robot file and table are of one robot, and each joint column of its joint."
    if result.decomposition is not None and (doubt := result.decomposition.apart.doubtful):
        return f"Check the table: {doubt}. Then diagnose again."
    if overstated(result):
        return "State the noise of the instrument (sigma_position: 0.02 mm, say) and diagnose again."
    if (apart := unstated_loads(result.baseline)) > 0.0:
        return (
            f"Are the columns fx fy fz missing? Readings of one posture lie {rounded(1e3 * apart)} mm apart, "
            "all in much the same direction, and no row states a load. If loads acted, add these columns and "
            "diagnose again."
        )
    if result.loads_contradicted:
        return (
            "Correct the weights in the robot file, or the loads in the table: measured torques contradict "
            "them (notes), and stiffness and causes follow from them. Then diagnose again."
        )
    if head == NOTHING.capitalize():
        write = (
            "Write the calibrated robot (--apply FILE, or beamstiff calibrate --out FILE) and use it"
            if calibrated_away(result)
            else "Use the fitted model (--apply FILE writes it)"
        )
        return f"{write} within the postures and loads measured. {NO_CAUSES}"
    if result.rms > LARGE_DISPLACEMENT:
        gap = rounded(1e3 * result.rms)
        return f"Check joint readings, units and robot file: {gap} mm are too much for an effect."
    if calibrated_worse(result):
        return (
            "Measure more postures, and diagnose them together with those from before, by the robot file "
            "from before its calibration."
        )
    to_check = [one for one in told(result) if one.effect in EFFECTS]
    of_the_load = not to_check or any(one.effect in OF_THE_LOAD for one in to_check)
    if of_the_load and (moved := moved_load(result)):
        return moved
    if moved := next((said for one in to_check if (said := _elsewhere(one))), ""):
        return moved
    like_sag = not to_check or any(one.effect in LIKE_SAG for one in to_check)
    if like_sag and weightless(result.baseline):
        return f"Give the robot file `masses`, estimates are enough, and diagnose again: {WEIGHT}."
    if (law := result.law) and not law.nameless:
        effect = EFFECTS[law.forms[0].effect]
        return (
            f"To check it: {effect.separation}. The robot that --apply writes has it as {effect.name}: "
            "beamstiff verify counts with it, compensate does not, as it is no error of the robot."
        )
    if law:
        return f"Check whether {law_in_words(law)}; mend that, measure again and diagnose the new table."
    if not to_check:
        return _also(result, "Measure").strip() or _by_remainder(result)
    if rigid := _compliant(result):
        return f"{rigid_text(result.baseline.nominal, rigid)} Then diagnose again."
    far = [(one, size) for one, size in unrealistic(result) if one.effect in EFFECTS]
    first = far[0][0] if far else to_check[0]
    return f"To check {named(first)}: {_check(result, first)}.{_also(result, 'Also measure')}"


def _check(result: Diagnosis, cause: Candidate) -> str:
    """Return the measurement that distinguishes a cause from its look-alikes, an instruction."""
    own = [one.indistinguishable for one in several(result) if one.key == cause.key]
    others = own[0] if own else (result.verdict.key, *result.indistinguishable)
    told = (alike_in_positions(cause.key, other, result.baseline) for other in others)
    return next(filter(None, told), EFFECTS[cause.effect].separation)


def scatters(result: Diagnosis) -> bool:
    """Return whether what is left of readings with a stated noise follows nothing that rows state."""
    found = result.decomposition
    if found is None or not result.baseline.claimed or found.every or found.unmodelled:
        return False
    return found.gap_shows and not (found.remainder.follows or found.remainder.where or found.apart.left_out)


def overstated(result: Diagnosis) -> float:
    """Return how many times the stated noise is what is left of the readings, where that is no chance; or 0.

    What leaves no micrometre was written by a program, and not read.
    """
    left = result.features.get("scatter", 1.0)
    if not result.baseline.claimed or result.rms < SIMULATED:
        return 0.0
    return 1.0 / left if 0.0 < left < SILENCE else 0.0


def _drives(result: Diagnosis) -> str:
    """Return what to do about drives that are rigid in the robot file, or of which the rows say nothing."""
    base = result.baseline
    felt = bool(base.rows.wrench.any()) or (base.absolute and not weightless(base))
    rigid = [] if not felt or _compliant(result) else rigid_drives(base.nominal)
    rigid = [name for name in rigid if _is_loaded(base, name)]
    fitted, guessed = [*result.linear_stiffness], {*result.untouched, *result.undetermined}
    # nothing is fitted where no row loads a drive
    unknown = [name for name in fitted if name in guessed] if fitted else fitted_names(base.nominal)
    return " ".join(
        filter(None, (rigid_text(base.nominal, rigid), undetermined_text(unknown, result.untouched)))
    )


def _is_loaded(base: Baseline, name: str) -> bool:
    """Return whether rows load a joint in its own direction: of no other a stiffness would show."""
    joint = next(joint for joint in base.nominal.joints if joint.name == name)
    axis = axis_at(base, component_of(base.nominal, joint))
    return bool(axis.load.any() or (base.absolute and axis.dead.any()))


def _compliant(result: Diagnosis) -> list[str]:
    """Return the drives that are rigid in the robot file, if a compliance of one is told or a look-alike."""
    robot = result.baseline.nominal
    alike = [key for one in several(result) for key in one.indistinguishable]
    found = {*(one.key for one in told(result)), *alike}
    rigid = rigid_drives(robot)
    own = [key_of("joint-compliance", joint.variable) for joint in robot.joints if joint.name in rigid]
    return rigid if found & {ALL_DRIVES, *own} else []


def _by_remainder(result: Diagnosis) -> str:
    """Return what to measure next of a gap without a cause: what its remainder follows, varied by itself."""
    found = result.decomposition
    if scatters(result):
        return (
            "Read some postures several times without moving the robot, and others again after moving it: "
            "what scatters while it stands is the instrument's noise, to be stated as sigma_position."
        )
    if found is None or not found.remainder.follows:
        return "Measure other postures and load directions; beamstiff plan chooses them."
    what = found.remainder.follows[0][0]
    how, _, name = (what, "", "") if what in VARIED else what.rpartition(" of ")
    vary = VARIED[how].format(name)
    return f"The gap follows the {what}: {vary}. Diagnose the old and the new rows together."


def _elsewhere(cause: Candidate) -> str:
    """Return, in words, where a load acts whose error is that of a wrong place; empty for another error."""
    lever = load_lever(cause)
    if lever is None:
        return ""
    place = ", ".join(f"{1e3 * one:+.0f}" for one in lever)
    return (
        f"Check where the load acts. The error looks like a load that acts about ({place}) mm, along the "
        "tool's axes, from where the robot file says. Correct the link in --tcp or the column "
        "load_point, and diagnose again."
    )


def _also(result: Diagnosis, measure: str) -> str:
    """Return the states to measure as a line after others, `measure` its verb; empty without."""
    if not result.next:
        return ""
    if result.next[0]["separates"] and not _decides(result):
        few = f"even {proposed(result)} add little{_written(result)}"
        return f"\nMore readings like these will not decide: {few}"
    return f"\n{measure} {proposed(result)}{_written(result)}"


def _decides(result: Diagnosis) -> bool:
    """Return whether the proposed states, which all separate the same causes, move their odds."""
    return bool(sum(item["discrimination"] for item in result.next) >= DECIDES)


def _written(result: Diagnosis) -> str:
    """Return what loads the proposed states have, and which option writes them."""
    force = max(float(np.linalg.norm(item["wrench"][:3])) for item in result.next)
    loaded = bool(np.any(result.baseline.rows.wrench))
    loads = f", under loads as in the table, at most {float(f'{force:.3g}'):g} N" if force and loaded else ""
    return f"{loads} (--next FILE writes them)."


def proposed(result: Diagnosis) -> str:
    """Return, in words, how many states the test plan proposes, and where else to read them."""
    told: dict[str, float] = {}
    for item in result.next:
        told[item["point"]] = told.get(item["point"], 0.0) + item["discrimination"]
    rivals = any(item["separates"] for item in result.next)
    count = len(result.next) // len(told)
    verb = ("discriminate" if rivals else "determine") + ("" if count > 1 else "s")
    what = f"{verb} best between the causes" if rivals else f"{verb} the sizes of the causes best"
    if not rivals and result.indistinguishable and result.decomposition is not None:
        what += " (no state like those measured distinguishes the look-alikes)"
    states = f"the {counted(count, 'state')} that {what}"
    if (same := result.next[0].get("alike")) and _decides(result):
        first = in_words(result.next[0]["separates"][:1])
        states += f", but do not distinguish {first} from {in_words(same)}"
    if free := [one.name for one in result.baseline.nominal.actuated if one.limits is None]:
        states += f", within the measured range of {listed(free, 3)} (no limits in the robot file)"
    tcp = told.pop(next(iter(told)))  # one point, or the TCP and another
    for node, there in told.items():
        times = f" {there / tcp:.0f} times as well" if there < 1e3 * tcp else ", as the TCP does not"
        near = [joint.name for joint in result.baseline.nominal.joints if node in joint.nodes]
        place = f"{node} ({', '.join(near)})" if near else node
        states += f"; also read a reflector on {place}, which discriminates{times}"
    return states


def separations(result: Diagnosis) -> list[str]:
    """Return, in words, the measurements that separate the verdict from its look-alikes."""
    found = {one.effect: one for one in reversed(told(result)) if one.effect in EFFECTS}
    each = {name: _check(result, found[name]) for name in reversed(found)}
    return [
        f"To check {listed([name for name, how in each.items() if how == said])}: {said}."
        for said in dict.fromkeys(each.values())
    ]
