"""Drives of a rigid four-bar and of its elastic twin: `python -m benchmarks.rigid_loops --cases 100`.

The IR-663 with rigid links and bearings, whose loop leaves the reactions across its plane undetermined, and
its twin whose links and bearings are a thousand times as stiff as the robot file has them. Rigid links have
their weight too, half of it at either end, for laws of the torque count with it. Both machines get the same
effect at a drive, or none, of a size drawn to leave 1.2 to 6 times the noise, and are measured in the same
campaign with the same noise by the exam's simulator, which shares no equations with the diagnosis; each is
diagnosed by its own model. What to measure next takes half the time, bears on no verdict and is left out.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from unittest.mock import patch

import numpy as np

import beamstiff
from beamstiff import Robot, load_robot
from beamstiff.exam.campaign import Truth
from beamstiff.exam.designs import Wish, draw_campaign
from beamstiff.exam.forms import draw_truth
from beamstiff.exam.record import Answer, answer_of
from beamstiff.exam.simulate import draw_stiffness, simulate
from beamstiff.exam.sizes import sized
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.parts import Mass, Rigid
from beamstiff.robot.sections import section_properties

DRIVES = ("J12.torsional", "J18.torsional")
STIFFER = 1e3  # links and bearings of the twin over those of the robot file
EFFECTS = ("backlash", "hardening", "actuator-lever", "hysteresis", "joint-coupling")
NULLS = 0.3  # of the cases have nothing wrong
NAMED, ALARMS = 0.85, 0.02  # what is asked


def rigid_four_bar() -> Robot:
    """Return the IR-663 of which the drives alone are elastic."""
    robot = load_robot("ir663")
    held = robot.with_parameters({f"{joint.name}.radial": RIGID for joint in robot.joints})
    links = tuple(Rigid(name=beam.name, nodes=beam.nodes) for beam in robot.beams)
    return held.model_copy(
        update={"beams": (), "rigids": links, "masses": (*robot.masses, *_weights(robot)), "identify": DRIVES}
    )


def _weights(robot: Robot) -> list[Mass]:
    """Return half the mass of every beam at either end: statically the same as along a rigid link."""
    kinematics = compile_kinematics(robot)
    middle = [[np.mean(one.limits or (0.0, 0.0)) for one in robot.actuated]]
    position = posture(kinematics, middle).node_positions[0]
    found = []
    for beam in robot.beams:
        a, b = (position[kinematics.node_index[name]] for name in beam.nodes)
        per_length = (
            robot.materials[beam.material].density * section_properties(robot.sections[beam.section]).A
        )
        half = 0.5 * float(per_length * np.linalg.norm(b - a))
        found += [Mass(node=name, mass=half) for name in beam.nodes]
    return found


def elastic_twin(stiffer: float = STIFFER) -> Robot:
    """Return the IR-663 with links and bearings so many times as stiff as in its file."""
    robot = load_robot("ir663")
    stiff = {
        name: stiffer * robot.parameter(name) for name in (f"{joint.name}.radial" for joint in robot.joints)
    }
    materials = {
        name: one.model_copy(update={"E": stiffer * one.E, "G": stiffer * one.G})
        for name, one in robot.materials.items()
    }
    return robot.with_parameters(stiff).model_copy(update={"materials": materials, "identify": DRIVES})


@dataclass(frozen=True)
class Case:
    """What is wrong with both machines, and what is said of them: first the rigid one, then its twin."""

    truth: str
    gap: float
    answers: tuple[Answer, Answer]
    seconds: tuple[float, float]

    def exact(self, at: int) -> bool:
        """Return whether the effect and its place are named, and nothing else."""
        return (self.answers[at].verdict, *self.answers[at].also) == (self.truth,)

    def in_set(self, at: int) -> bool:
        """Return whether the effect is named, or called indistinguishable from what is named."""
        return self.truth in (self.answers[at].verdict, *self.answers[at].indistinguishable)

    @property
    def same(self) -> bool:
        """Whether both verdicts are the same."""
        return self.answers[0].verdict == self.answers[1].verdict


def examined(seed: int, number: int) -> Case:
    """Return a case, drawn from ``[seed, number]`` alone."""
    rng = np.random.default_rng([seed, number])
    rigid, twin = rigid_four_bar(), elastic_twin()
    wish = Wish("rich", "displacement", 6 if rng.random() < 0.5 else 3, "true")
    effect = None if rng.random() < NULLS else EFFECTS[number % len(EFFECTS)]
    campaign = draw_campaign(rng, rigid, wish)
    true = draw_stiffness(rng, rigid)
    truths: Sequence[Truth] = ()
    gap = 0.0
    if effect is not None:
        # of pairs the exam draws sizes that leave 1.2 to 6 times the noise
        drawn = (draw_truth(rng, rigid, effect, 0.5),)
        (one,) = sized(rng, rigid, rigid.with_parameters(true), campaign, drawn, "pair")
        truths, gap = (one.truth,), one.gap
    answers, seconds = [], []
    for robot in (rigid, twin):
        noise = np.random.default_rng([seed, number, 1])
        rows = simulate(robot.with_parameters(true), truths, campaign, noise)
        start = time.process_time()
        answers.append(answer_of(beamstiff.diagnose(robot, rows).to_dict()))
        seconds.append(time.process_time() - start)
    truth = truths[0].label if truths else "none:null"
    return Case(truth, gap, (answers[0], answers[1]), (seconds[0], seconds[1]))


def table(cases: Sequence[Case]) -> list[str]:
    """Return the table of what was asked and what was reached."""
    null = [case for case in cases if case.truth == "none:null"]
    lines = [
        "| cases | number | rigid: exact | in its set | twin: exact | in its set | same verdict |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    some = {effect: [case for case in cases if case.truth.startswith(effect)] for effect in EFFECTS}
    some["all with an effect"] = [case for case in cases if case not in null]
    for name, group in [*some.items(), ("nothing wrong", null)]:
        counts = [
            sum(count)
            for count in (
                [case.exact(0) for case in group],
                [case.in_set(0) for case in group],
                [case.exact(1) for case in group],
                [case.in_set(1) for case in group],
                [case.same for case in group],
            )
        ]
        lines.append(
            f"| {name} | {len(group)} | " + " | ".join(f"{n} of {len(group)}" for n in counts) + " |"
        )
    effects = some["all with an effect"]
    for at, name in enumerate(("rigid", "twin")):
        named = sum(case.exact(at) for case in effects) / max(len(effects), 1)
        alarms = sum(not case.exact(at) for case in null) / max(len(null), 1)
        lines += [
            f"{name}: named exactly {named:.1%}, asked {NAMED:.0%}, {_how(named >= NAMED)}; "
            f"false alarms {alarms:.1%}, asked {ALARMS:.0%}, {_how(alarms <= ALARMS)}; "
            f"{np.mean([case.seconds[at] for case in cases]):.1f} s a diagnosis"
        ]
    return lines


def _how(reached: bool) -> str:
    return "reached" if reached else "missed"


@patch("beamstiff.diagnosis.diagnose.propose_tests", lambda *_: None)
@patch("beamstiff.diagnosis.diagnose.with_next", lambda found, _: found)
def main() -> None:
    """Print every case, then the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    given = parser.parse_args()
    cases = []
    for number in range(given.first, given.first + given.cases):
        case = examined(given.seed, number)
        cases.append(case)
        said = " / ".join(one.verdict for one in case.answers)
        sure = " ".join("exact" if case.exact(at) else "set" if case.in_set(at) else "-" for at in (0, 1))
        print(f"{number}: {case.truth}, gap {case.gap:.2f}: {said} ({sure})", flush=True)
        if number % 10 == 9:
            print("\n".join(table(cases)), flush=True)
    print("\n".join(table(cases)))


if __name__ == "__main__":
    main()
