"""Cases drawn at random, each from its own seed: a machine, what is wrong with it, how it is measured."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import SimulatedCampaign, Truth
from beamstiff.exam.designs import (
    draw_campaign,
    draw_fresh,
    draw_wish,
    largest_force,
    planned,
    simulated_alike,
)
from beamstiff.exam.forms import OUTSIDE, author_of, draw_truth, resized
from beamstiff.exam.names import EFFECTS
from beamstiff.exam.record import KINDS, Kind, Label, sha256
from beamstiff.exam.robots import ROBOTS, exam_robot, with_payload, with_stiff_drive
from beamstiff.exam.simulate import draw_stiffness
from beamstiff.exam.sizes import DIGITS, sized
from beamstiff.measure.table import Measurements
from beamstiff.measure.writer import measurements_to_csv
from beamstiff.robot.description import Robot
from beamstiff.robot.writer import robot_to_yaml

# cases of each kind in every hundred: 1720 hold 516 nulls and 40 of each of the 18 effects, lean ones too
SHARES: Mapping[Kind, int] = {"null": 30, "single": 42, "pair": 9, "outside": 9, "removed": 10}
PLAN_SHARES: Mapping[Kind, int] = {"null": 25, "single": 75}

STIFF_DRIVE = 0.08  # of the models hold one drive rigid, those with a joint compliance to find always
TRIES = 60
GRAVITY = 9.81
K = TypeVar("K", bound=str)


@dataclass(frozen=True, eq=False)
class Exam:
    """What an exam draws its cases from, in blocks with these shares; the same exam draws the same cases."""

    seed: int
    shares: Mapping[Kind, int] = field(default_factory=lambda: dict(SHARES))
    effects: tuple[str, ...] = EFFECTS  # to draw from, in turn
    robots: tuple[str, ...] = tuple(ROBOTS)  # names to draw from
    lean: float = 0.2  # share of lean campaigns
    robot: Robot | None = None  # one robot instead of those by name
    plan: Measurements | None = None  # one campaign instead of drawn ones, of that robot
    noise: tuple[float, float] = (3e-5, 5e-5)  # m and rad: of the plan, where its table does not say

    def settings(self) -> dict[str, Any]:
        """Return what the cases depend on, as plain data; files by their SHA-256."""
        return {
            "seed": self.seed,
            "shares": {kind: self.shares[kind] for kind in KINDS if self.shares.get(kind)},
            "effects": list(self.effects),
            "robots": list(self.robots) if self.robot is None else [self.robot.name],
            "lean": self.lean,
            "robot": self.robot and sha256(robot_to_yaml(self.robot)),
            "plan": self.plan and self.robot and sha256(measurements_to_csv(self.plan, self.robot)),
            "noise": list(self.noise),
        }


@dataclass(frozen=True, eq=False)
class Case:
    """A drawn case."""

    label: Label
    robot: Robot  # the model that is diagnosed: its stiffness is nominal
    machine: Robot  # the machine without its effects: its stiffness is true
    truths: tuple[Truth, ...]
    campaign: SimulatedCampaign  # what is measured
    fresh: SimulatedCampaign  # the new poses and loads that promises are tested on


def kind_of(exam: Exam, case: int) -> tuple[Kind, int]:
    """Return the kind of a case, in an order drawn for its block, and how many of that kind come before."""
    return dealt(exam.seed, {kind: exam.shares.get(kind, 0) for kind in KINDS}, case)


def dealt(seed: int, shares: Mapping[K, int], case: int) -> tuple[K, int]:
    """Return the kind of a case, of kinds in these shares, and how many of that kind come before it."""
    kinds = [kind for kind, share in shares.items() for _ in range(share)]
    if not kinds:
        raise BeamstiffError("exam: found no kind of case with a share, expected at least one")
    block, at = divmod(case, len(kinds))
    order = np.random.default_rng([seed, block, len(kinds), 2]).permutation(len(kinds))
    shuffled = [kinds[k] for k in order]
    kind = shuffled[at]
    return kind, block * shares[kind] + shuffled[:at].count(kind)


def possible_effects(robot: Robot, effects: tuple[str, ...] = EFFECTS) -> tuple[str, ...]:
    """Return those of the effects that a robot can have at all."""
    found = []
    for effect in effects:
        try:
            draw_truth(np.random.default_rng(0), robot, effect, 0.5)
        except BeamstiffError:
            continue
        found.append(effect)
    return tuple(found)


def draw_case(exam: Exam, case: int) -> Case:
    """Return a case, from the generator of ``[seed, case]`` alone.

    Raises BeamstiffError when no robot of the exam can have the effect.
    """
    rng = np.random.default_rng([exam.seed, case])
    kind, before = kind_of(exam, case)
    effects = tuple(effect.name for effect in OUTSIDE) if kind == "outside" else exam.effects
    effect = "none" if kind == "null" else effects[before % len(effects)]
    weights = np.array([ROBOTS.get(name, 1.0) for name in exam.robots])
    why = ""
    for _ in range(TRIES):
        robot_name = str(rng.choice(exam.robots, p=weights / weights.sum()))
        robot = exam.robot or exam_robot(robot_name, rng)
        if exam.robot is None and (effect == "joint-compliance" or rng.random() < STIFF_DRIVE):
            robot = with_stiff_drive(robot, rng)
        try:
            truths = _draw_truths(rng, robot, kind, effect, exam.effects)
        except BeamstiffError as error:
            why = str(error)
            continue
        return _drawn(exam, rng, robot, case, kind, truths)
    raise BeamstiffError(f"exam: case {case}: no robot can have {effect!r}: {why}")


def _draw_truths(
    rng: np.random.Generator, robot: Robot, kind: Kind, effect: str, effects: tuple[str, ...]
) -> tuple[Truth, ...]:
    if kind == "null":
        return ()
    first = draw_truth(rng, robot, effect, 0.5)
    if kind != "pair":
        return (first,)
    for _ in range(TRIES):
        other = str(rng.choice(effects))
        if other == effect:
            continue
        try:
            second = draw_truth(rng, robot, other, 0.5)
        except BeamstiffError:
            continue
        if second.component != first.component:
            return first, second
    raise BeamstiffError(f"robot {robot.name!r} has no second effect at another place beside {first.label}")


def _drawn(
    exam: Exam, rng: np.random.Generator, robot: Robot, case: int, kind: Kind, truths: tuple[Truth, ...]
) -> Case:
    """Return a case of some effects, whose sizes are found here."""
    wish = draw_wish(rng, truths, exam.lean)
    if exam.plan is not None:
        campaign = planned(rng, exam.plan, exam.noise)
        if not simulated_alike(robot, campaign.q).all():
            raise BeamstiffError(f"{exam.plan.source}: loops close otherwise in the simulator at some poses")
    else:
        if wish.data == "absolute" or rng.random() < 0.5:
            mass = rng.uniform(0.2, 0.7) * largest_force(robot, rng) / GRAVITY
            robot = with_payload(robot, float(mass), tuple(rng.uniform(-0.1, 0.1, 3).tolist()))
        campaign = draw_campaign(rng, robot, wish)
    machine = robot.with_parameters(draw_stiffness(rng, robot))
    fresh = draw_fresh(rng, robot, campaign)
    if exam.plan is not None:  # what the plan could find of all that there may be
        sizes = tuple(round(float(rng.random()), DIGITS) for _ in truths)
        pairs = zip(truths, sizes, strict=True)
        truths = tuple(resized(truth, robot, size, int(rng.integers(2**31))) for truth, size in pairs)
    else:
        found = sized(rng, robot, machine, campaign, truths, kind)
        truths, sizes = tuple(one.truth for one in found), tuple(one.size for one in found)
    label = Label(
        case=case,
        kind=kind,
        truths=tuple(truth.label for truth in truths),
        sizes=sizes,
        withheld=(truths[0].effect,) if kind == "removed" else (),
        robot=robot.name,
        design="plan" if exam.plan is not None else wish.design,
        data=campaign.kind,
        claimed=wish.claimed if exam.plan is None else "true",
        readings=6 if campaign.rotations else 3,
        forms=tuple(truth.form for truth in truths),
        author=max(map(author_of, truths), default=1),
    )
    return Case(label, robot, machine, truths, campaign, fresh)
