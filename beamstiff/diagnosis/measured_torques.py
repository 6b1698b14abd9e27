"""What measured torques of the drives say of weights and loads, beside the torques that statics says.

At rest a drive holds the weight of what it carries, the loads, and friction. So a reading is linear in the
payload's error, a balancer's torque, errors of the loads and of the links' weights, friction by direction of
approach, and the sensor's own offset and gain. All are fitted to the readings of all joints together. The
odds of each, tempered, become the prior of the positions, which are other readings (as of `behind_gears`).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import expit, logit

from beamstiff.diagnosis.decomposition.behind_gears import SLIGHT, probabilities, score
from beamstiff.diagnosis.decomposition.causes import PRESENT
from beamstiff.diagnosis.decomposition.open_model import inverse_of, orthonormal
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.approach_direction import last_direction
from beamstiff.diagnosis.prior import DEFAULT, TEMPERING, Prior, key_of
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline
from beamstiff.diagnosis.torque_readings import Readings, readings_of
from beamstiff.errors import listed
from beamstiff.identification.input_errors import rigid_motion
from beamstiff.measure.table import Measurements, Names
from beamstiff.model.drive_torques import Weight, drive_torques
from beamstiff.robot.coupling import variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array

GAIN = 0.1  # standard deviation of a sensor's gain: of motor currents; strain gauges are better
FINEST = 2e-3  # of what a joint holds: no torque is read to better, nor are weights known
WEIGHT = 0.2  # standard deviation of the weights that a robot file states, as a share
SPRING = 0.5  # realistic share of a balancer, of what a joint holds
PLAIN = 4.0  # standard deviations from which friction shows
BESIDE_EFFECTS = "measured torques are not used: what the robot's effects make of them is not known"
BALANCER = "gravity-compensator"
LIKELY = {"weights": 0.2, "weight": 0.1}  # of the weight of all links by one factor, of what hangs on a frame
ROUNDS = 3  # of weighing the joints by their noise
FEW = 6  # most parameters of a form
SURE = 0.5  # probability from which it is said
# what friction does to positions where it acts behind the gear, and how likely: engineering estimate
MOTIONS, MOVES = ("approach-direction", "hysteresis"), 0.2


@dataclass(frozen=True)
class Said:
    """What the torques say.

    `given`: how likely effects are after them, by ``effect:component``.
    `doubts`: where they contradict weights and loads as stated.
    `notes`: what else there is to say: what is not used, friction, agreement.
    `sure`: whether one of the doubts is.
    """

    given: dict[str, float] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sure: bool = False

    def informed(self, prior: Prior) -> Prior:
        """Return the prior after the torques were read."""
        return replace(prior, measured=self.given)


@dataclass(frozen=True)
class _Form:
    """A way in which something shows: columns (M, c) of realistic sizes; `stated`: whether those bound it."""

    name: str
    columns: Array
    parameters: tuple[str, ...]
    sizes: Array
    stated: bool = False


def measured_torques(robot: Robot, rows: Measurements, prior: Prior = DEFAULT) -> Said:
    """Return what the measured torques of rows say; nothing where there are none.

    Raises BeamstiffError as of `fit_baseline`: a pose that does not close its loops.
    """
    if not np.isfinite(rows.torque).any():
        return Said()
    if robot.effects:
        return Said(notes=(BESIDE_EFFECTS,))
    weights, loads = drive_torques(robot, rows)
    carried = robot.nodes[compile_kinematics(robot).node_index[robot.tcp]].frame
    links = [one for one in weights if one.frame != carried and np.abs(one.unit).any()]
    if any(robot.gravity) and not any(np.abs(one.torque).any() for one in links):
        return Said(notes=("measured torques are not used: the robot file states no weight of the links",))
    read = readings_of(rows, np.sum([loads, *(one.torque for one in weights)], axis=0))
    if not len(read.row):
        return Said(notes=read.notes)
    baseline = fit_baseline(robot, rows, keep=())
    return _said(baseline, read, dict(_candidates(baseline, read, links)), prior)


def _candidates(
    baseline: Baseline, read: Readings, links: Sequence[Weight]
) -> Iterator[tuple[str, list[_Form]]]:
    """Yield what the difference may come from, by ``what:where``, and its forms."""
    rows, robot = baseline.rows, baseline.nominal
    held = read.rms(read.of(read.statics))

    def scaled(name: str, columns: Array, share: float, *parameters: str, stated: bool = False) -> _Form:
        """Return columns (N, A, c) of a size that makes a share of what some joint holds."""
        found = read.of(columns)
        parts = [read.rms(one) / np.where(held > 0.0, held, np.inf) for one in found.T]
        most = np.max(parts, axis=1)
        sizes = np.divide(share, most, out=np.zeros(len(most)), where=most > 0.0)
        return _Form(name, found * sizes, parameters, sizes, stated)

    if any(robot.gravity):
        yield (
            key_of("payload-error", None),
            _of_effect(baseline, read, "payload-error", np.full(len(rows), robot.tcp)),
        )
        every = np.sum([one.torque for one in links], axis=0)[..., None]
        yield "weights", [scaled("all links", every, WEIGHT, "share", stated=True)]
    if rows.wrench.any():
        yield key_of("load-error", None), _of_effect(baseline, read, "load-error", rows.load_point)
    for one in links:
        share = scaled("share", one.torque[..., None], WEIGHT, "share", stated=True)
        yield f"weight:{one.frame}", [share, scaled("free", one.unit, WEIGHT, "mass", *"xyz", stated=True)]
    level = EFFECTS[BALANCER].components(baseline)
    for at in np.unique(read.joint).tolist():
        name = rows.variables[at]
        if name in level:
            turn = rows.q[:, at][:, None] * np.array([1, 2])
            own = np.zeros((*read.statics.shape, 4))
            own[:, at] = np.concatenate([np.sin(turn), np.cos(turn)], axis=1)[:, [0, 2, 1, 3]]
            once, twice = ("sine", "cosine"), ("sine_2", "cosine_2")
            springs = [
                scaled("once", own[..., :2], SPRING, *once),
                scaled("twice", own, SPRING, *once, *twice),
            ]
            yield key_of(BALANCER, name), springs


def _of_effect(baseline: Baseline, read: Readings, effect: str, point: Names) -> list[_Form]:
    """Return the forms of an effect that acts as a wrench at a point of each row.

    What wrenches displace by a response, they make drives hold by ``-J^T`` in its place: six joints at once.
    """
    rows = replace(baseline.rows, load_point=point)
    undirected = replace(rows, point=point, direction=np.full_like(rows.direction, np.nan))
    holds = -rigid_motion(baseline.nominal, undirected).swapaxes(1, 2)  # (N, A, 6)
    count = holds.shape[1]
    holds = np.pad(holds, ((0, 0), (0, -count % 6), (0, 0)))
    parts = [
        EFFECTS[effect].shapes(replace(baseline, rows=rows, response=holds[:, at : at + 6]), None)
        for at in range(0, count, 6)
    ]
    found = []
    for shapes in zip(*parts, strict=True):
        first = shapes[0]
        if first.weight == 1.0 and len(first.parameters) <= FEW:
            sizes = np.array([one.size for one in first.parameters])
            columns = read.of(np.concatenate([one.columns for one in shapes], axis=1)) * sizes
            found.append(_Form(first.name, columns, tuple(one.name for one in first.parameters), sizes))
    return found


@dataclass(frozen=True)
class _Weighed:
    """Candidates, weighed by the readings.

    `value`, `beside`: (M + k,), (M + k, z) array; readings and nuisance, of which the first `zeros` columns
        are offsets; as of `_stacked`.
    `columns`: dict of str to list of (M + k, c) array.
    `sigma`: (M,) array.
    `likely`, `odds`: before the readings, and after.
    `picked`: the form of each that is chosen, in the order of their columns in `causes`.
    `causes`: (M + k, z + c) array.
    """

    value: Array
    beside: Array
    zeros: int
    columns: Mapping[str, Sequence[Array]]
    sigma: Array
    likely: Mapping[str, float]
    odds: Mapping[str, float]
    chosen: set[str]
    picked: Mapping[str, int]
    causes: Array


def _weighed(baseline: Baseline, read: Readings, forms: Mapping[str, list[_Form]], prior: Prior) -> _Weighed:
    """Return which candidates the readings need."""
    rows, joints = baseline.rows, np.unique(read.joint)
    zero = np.unique(np.column_stack([read.joint, rows.run[read.row]]), axis=0, return_inverse=True)[1]
    zeros = np.eye(zero.max() + 1)[zero.reshape(-1)]
    own = (read.joint[:, None] == joints).astype(np.float64)
    way = np.stack([last_direction(rows, name) for name in rows.variables], axis=1)
    nuisance = np.hstack([zeros, own * read.of(way)[:, None], own * read.of(read.statics)[:, None]])
    value, beside, columns, sigma = _stacked(read, nuisance, forms)
    likely = {name: LIKELY.get(name.partition(":")[0]) or _expected(prior, name) for name in forms}
    odds = probabilities(value, beside, columns, likely)
    alone = {name: min(score(value, np.hstack([beside, one])) for one in columns[name]) for name in odds}

    def fitted(names: Iterable[str]) -> tuple[Array, dict[str, int]]:
        """Return the columns of causes, and which form of each is best beside the others."""
        picked: dict[str, int] = {}
        for name in 2 * sorted(names, key=alone.__getitem__):
            others = (columns[one][at] for one, at in picked.items() if one != name)
            every = np.hstack([beside, *others])
            picked[name] = int(np.argmin([score(value, np.hstack([every, one])) for one in columns[name]]))
        return np.hstack([beside, *(columns[one][at] for one, at in picked.items())]), picked

    chosen = {name for name in odds if odds[name] > SURE}
    causes, picked = fitted(chosen)
    for name in (one for one in odds if one.startswith(BALANCER)):
        for other in (one for one in odds if one.startswith("weight")):
            if (name in chosen) != (other in chosen):  # another weight of what the joint turns looks alike
                better = 0.5 * (score(value, causes) - score(value, fitted(chosen ^ {name, other})[0]))
                toward = (-better if name in chosen else better) / TEMPERING
                instead = float(expit(toward + logit(likely[name]) - logit(likely[other])))
                odds[name] = (min if name in chosen else max)(odds[name], instead)
    return _Weighed(value, beside, zeros.shape[1], columns, sigma, likely, odds, chosen, picked, causes)


def _said(baseline: Baseline, read: Readings, every: Mapping[str, list[_Form]], prior: Prior) -> Said:
    """Return what the readings say of candidates."""
    rows, joints = baseline.rows, np.unique(read.joint)
    some = {name: [one for one in forms if one.columns.any()] for name, forms in every.items()}
    forms = {name: own for name, own in some.items() if own}
    found = _weighed(baseline, read, forms, prior)
    odds, value = found.odds, found.value
    kinds = variable_kinds(baseline.nominal)
    units = ["N*m" if kinds[name] == "angle" else "N" for name in rows.variables]

    def differences(columns: Array) -> str:
        left = read.rms(_left(value, columns)[: len(found.sigma)] * found.sigma)
        return listed([f"{rows.variables[at]} {left[at]:.4g} {units[at]}" for at in joints], 12)

    inverse, first = inverse_of(found.causes), found.beside.shape[1]
    doubts, notes = list[str](), list(read.notes)
    for name, at in found.picked.items():
        form = forms[name][at]
        part = slice(first, first := first + len(form.sizes))
        theta = (inverse[part] @ value) * form.sizes
        text = _text(name, form, theta, np.linalg.norm(inverse[part], axis=1) * form.sizes)
        doubts.append(f"measured torques: {text} ({100 * odds[name]:.0f} %)")
    others = sorted(odds.keys() - found.chosen)
    for name in others if any(one.startswith("weight") for one in found.chosen) else ():
        if name.startswith(BALANCER) and odds[name] > found.likely[name]:
            text = f"a balancer at {name.partition(':')[2]} instead looks alike ({100 * odds[name]:.0f} %)"
            doubts.append(f"measured torques: {text}")
    if doubts:
        start = "measured torques differ from those of the stated weights and loads by (RMS)"
        raw, rest = differences(found.beside[:, : found.zeros]), differences(found.causes)
        doubts.insert(0, f"{start} {raw}; with the causes named next by {rest}")
    else:
        notes.append(f"measured torques agree with weights and loads to (RMS) {differences(found.causes)}")
    there = {key_of(one.name, at) for one in EFFECTS.values() for at in one.components(baseline)}
    given, rubs = dict(_given(there, odds, found.columns, found.beside, prior)), list[str]()
    for joint, row in zip(joints.tolist(), inverse[found.zeros :][: len(joints)], strict=True):
        name, friction = rows.variables[joint], abs(float(row @ value))
        if friction > PLAIN * np.linalg.norm(row):
            rubs.append(f"{name} {friction:.4g} {units[joint]}")
            motions = [key for one in MOTIONS if (key := f"{one}:{name}") in there]
            given |= {key: MOVES for key in motions if _expected(prior, key) < MOVES}
    if rubs:
        notes.append(f"measured torques: friction by the direction of the last motion, {listed(rubs, 12)}")
    sure = any(odds[name] >= PRESENT for name in found.picked)
    return Said(given, tuple(doubts), tuple(notes), sure)


def _stacked(
    read: Readings, nuisance: Array, forms: Mapping[str, Sequence[_Form]]
) -> tuple[Array, Array, dict[str, list[Array]], Array]:
    """Return readings, nuisance and forms in units of the noise, (M + k, ...), and the noise (M,).

    Below the readings stands what is known of gains, the last columns of the nuisance, and of the weights
    that are stated; and last what readings lack that are fitted to better than sensors are.
    """
    sigma = _noise(read, nuisance, np.hstack([own[-1].columns for own in forms.values()]))
    gains = len(np.unique(read.joint))
    below = np.zeros((gains + FEW * len(forms) + 1, nuisance.shape[1]))
    below[:gains, -gains:] = np.eye(gains) / GAIN
    columns: dict[str, list[Array]] = {}
    for at, (name, own) in enumerate(forms.items()):
        first = gains + FEW * at
        for form in own:
            known = np.zeros((len(below), len(form.sizes)))
            if form.stated:  # evidence is tempered, what is known is not
                known[first : first + len(form.sizes)] = np.sqrt(TEMPERING) * np.eye(len(form.sizes))
            columns.setdefault(name, []).append(np.vstack([form.columns / sigma[:, None], known]))
    value = np.concatenate([read.value / sigma, np.zeros(len(below))])
    beside = np.vstack([nuisance / sigma[:, None], below])
    richest = np.hstack([beside, *(own[-1] for own in columns.values())])
    value[-1] = np.sqrt(max(len(sigma) - float((_left(value, richest) ** 2).sum()), 0.0))
    return value, beside, columns, sigma


def _noise(read: Readings, nuisance: Array, others: Array) -> Array:
    """Return the standard deviation (M,) of each reading: of what everything leaves of those of its joint.

    Where the readings are too few for that, of what the nuisance leaves; no less than sensors are good for.
    """
    every = np.hstack([nuisance, others])
    if 2 * orthonormal(every).shape[1] > len(every):
        every = nuisance
    least = FINEST * read.rms(read.of(read.statics))[read.joint]
    sigma = np.ones(len(every))
    for _ in range(ROUNDS):
        basis = orthonormal(every / sigma[:, None])
        value = read.value / sigma
        left = (value - basis @ (basis.T @ value)) * sigma
        free = read.rms(np.sqrt(np.maximum(1.0 - (basis**2).sum(axis=1), 0.0)))[read.joint]
        sigma = np.maximum(read.rms(left)[read.joint] / np.maximum(free, 0.1), least)
    return sigma


def _left(value: Array, columns: Array) -> Array:
    basis = orthonormal(columns)
    return np.asarray(value - basis @ (basis.T @ value))


def _expected(prior: Prior, name: str) -> float:
    effect, _, where = name.partition(":")
    return prior.expected(effect, None if where == "null" else where)


def _given(
    there: set[str],
    odds: Mapping[str, float],
    columns: Mapping[str, Sequence[Array]],
    beside: Array,
    prior: Prior,
) -> Iterator[tuple[str, float]]:
    """Yield how likely effects are of which the torques can say it."""
    for name in sorted(odds.keys() & there):
        # what would not show at a usual size is as likely as before
        shows = max((_left(part, beside) ** 2).sum() for one in columns[name] for part in one.T)
        least = SLIGHT if shows > 2.0 * TEMPERING * np.log(len(beside)) else _expected(prior, name)
        yield name, float(np.clip(odds[name], min(least, 1.0 - SLIGHT), 1.0 - SLIGHT))


def _text(name: str, form: _Form, theta: Array, std: Array) -> str:
    """Return what an effect is, in words; parameters (c,) with standard deviations, SI."""
    kind, _, where = name.partition(":")
    if kind == "payload-error":
        ends = dict(zip(form.parameters, zip(theta, std, strict=True), strict=True))
        kilograms, error = ends.pop("mass", (0.0, np.inf))
        way = "more" if kilograms > 0 else "less"
        parts = [f"{abs(kilograms):.2g} ± {error:.1g} kg {way} at the tool"] if kilograms else []
        moment = np.array([value for value, _ in ends.values()])
        if abs(kilograms) > PLAIN * error and len(moment) == len("xyz"):
            centre = ", ".join(f"{1e3 * one:+.0f}" for one in moment / kilograms)
            parts.append(f"the centre of this at ({centre}) mm from the TCP, along the tool's axes")
        elif len(moment):
            parts.append("another centre of gravity")
        return f"payload-error, which fits with {' and '.join(parts)}"
    if kind == "weights":
        way = "more" if theta[0] > 0 else "less"
        return f"all links weigh about {100 * abs(theta[0]):.0f} % {way} than the robot file states"
    if kind == "weight":
        return f"what hangs on frame {where} has another mass or centre than the robot file states"
    if kind == "load-error":
        sizes = listed([f"{one} {size:.2g}" for one, size in zip(form.parameters, theta, strict=True)], FEW)
        return f"load-error, the loads are not as stated: {form.name} ({sizes}, SI)"
    return f"{kind} at {where}, a balancer of about {np.hypot(*theta[:2]):.4g} N*m, or an equal weight"
