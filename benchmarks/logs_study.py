"""Lag, drift and plateaus planted in bags, and found again: ``python -m benchmarks.logs_study``.

Every bag is drawn anew: an arm of three to seven joints with links of its own, motions of four profiles, all
joints at once or each in its own time; plateaus from 1 s on; creeping stretches in their place or right
behind them, of joints or of the tool alone; loads that are hung on in between; a tool that rings after
stopping; a tracker with a rate, noise (white or slow), jitter, lost readings, slow drift, and a clock of its
own, off by up to 5 s and 100 ppm. Written by rosbags as mcap, db3 and bag in turn.

A plateau is every planted still stretch: of 1 s and more, outside creep, ringing (until it is below the noise
of one reading) and changes of load. It is lost where no kept window covers 0.25 s of it. A kept window moves
where more than 0.05 s of it hold a motion above 1 um/s, or ringing above three times the noise, and its
readings can tell: whoever knew the course of the motion, and the noise with its correlation, would find it in
them at `TOLD` standard deviations (matched filter). Of joints and tracker the sum of squares counts. Motions
that no reading can tell are counted apart.

Nothing of the detector is used here: what is compared are the table, windows and lags that
`beamstiff.measure` hands out with what was drawn.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
FORMATS = ("mcap", "db3", "bag")
EPOCH = 1_700_000_000.0  # s, of the stamps
EDGE = 0.05  # s of a motion that a kept window may hold
LEAST_SPEED = 1e-6  # m/s of the tool, without ringing, from which it moves
LEAST_ROW = 0.25  # s of a plateau in a kept window, from which it is not lost
TOLD = 5.0  # standard deviations, from which readings tell that a window moves
RINGING = 3.0  # noise of one reading, above which a ringing tool moves


@dataclass
class Stay:
    """A stretch between two motions, or a part of one."""

    begin: float
    end: float
    still: bool
    what: str = "plateau"


@dataclass
class Run:
    """What was drawn: the truth of a bag."""

    seed: int
    form: str = ""
    stays: list[Stay] = field(default_factory=list)
    lag: float = 0.0
    drift: float = 0.0  # of the tracker's clock, s/s
    sigma: float = 0.0  # m, of one reading
    rate: float = 0.0  # Hz, of the tracker
    slow: float = 0.0  # s, over which half of the noise's variance is correlated; 0: white
    warming: Array = field(default_factory=lambda: np.zeros(3))  # m/s, of the tracker
    joint_sigma: float = 0.0  # rad, of one reading, its last digit included
    joint_time: Array = field(default_factory=lambda: np.zeros(0))  # s, of the readings
    time: Array = field(default_factory=lambda: np.zeros(0))
    joint_values: Callable[[Array], Array] = lambda t: t
    positions: Callable[[Array], Array] = lambda t: t
    moves: Callable[[Array], NDArray[np.bool_]] = lambda t: t > 0

    def lag_at(self, time: Array) -> Array:
        """Return how far the tracker's stamps are ahead of the joints' at times of the joints' clock."""
        return self.lag + self.drift * time


@dataclass
class Part:
    """A law of one joint, or of the tool, over a stretch."""

    begin: float
    end: float
    law: Callable[[Array], Array]  # (N,) share of the way, 0 to 1, by the share of the time


def profile(rng: np.random.Generator) -> Callable[[Array], Array]:
    """Return a way from 0 to 1: trapezoidal speed, cosine, minimum jerk or one that hurries off."""
    kind = rng.integers(4)
    if kind == 0:
        ramp = rng.uniform(0.1, 0.45)
        top = 1.0 / (1.0 - ramp)

        def trapezoid(s: Array) -> Array:
            up = 0.5 * top * s**2 / ramp
            flat = 0.5 * top * ramp + top * (s - ramp)
            down = 1.0 - 0.5 * top * (1 - s) ** 2 / ramp
            return np.where(s < ramp, up, np.where(s < 1 - ramp, flat, down))

        return trapezoid
    if kind == 1:
        return lambda s: 0.5 - 0.5 * np.cos(np.pi * s)
    if kind == 2:
        return lambda s: s**3 * (10 - 15 * s + 6 * s**2)
    power = rng.uniform(1.2, 1.8)
    return lambda s: (lambda u: u**3 * (10 - 15 * u + 6 * u**2))(1 - (1 - s) ** power)


def draw(seed: int) -> Run:
    """Return a run: the motion and the truth of its clocks."""
    rng = np.random.default_rng([31, seed])
    run = Run(seed, FORMATS[seed % 3])
    joints = int(rng.integers(3, 8))
    run.sigma = float(np.exp(rng.uniform(np.log(5e-6), np.log(5e-5))))
    run.rate = float(np.exp(rng.uniform(np.log(10.0), np.log(250.0))))
    slow_noise = bool(rng.random() < 0.3)
    run.lag = float(rng.uniform(-5, 5))
    run.drift = float(rng.uniform(-1e-4, 1e-4))
    q = rng.uniform(-1.0, 1.0, joints)
    begin_q = q.copy()
    time = 0.0
    motions: list[tuple[int, Part, float]] = []  # joint, law, amount
    tool: list[tuple[Part, Array]] = []  # shifts of the tool alone
    rings: list[tuple[float, Array, float, float]] = []

    def stand(length: float, still: bool = True, what: str = "plateau") -> None:
        nonlocal time
        run.stays.append(Stay(time, time + length, still, what))
        time += length

    def length() -> float:
        short = rng.random() < 0.35
        return float(rng.uniform(1.0, 1.3) if short else np.exp(rng.uniform(np.log(1.3), np.log(8.0))))

    def creep() -> None:
        nonlocal time, q
        spent = float(rng.uniform(1.0, 6.0))
        # at least five times the noise of one reading, at most 4 mm/s: faster ones are motions
        amount = float(np.exp(rng.uniform(np.log(5 * run.sigma), np.log(4e-3 * spent))))
        settling = rng.random() < 0.3
        tau = rng.uniform(0.2, 0.5)
        law: Callable[[Array], Array] = (
            (lambda s: (1 - np.exp(-s / tau)) / (1 - np.exp(-1 / tau))) if settling else (lambda s: s)
        )
        if rng.random() < 0.5:
            joint = int(rng.integers(joints))
            # as far as the tool should go, over a lever of half a metre and more
            motions.append((joint, Part(time, time + spent, law), amount / 0.5))
            q[joint] += amount / 0.5
        else:
            direction = rng.normal(size=3)
            tool.append((Part(time, time + spent, law), amount * direction / np.linalg.norm(direction)))
        stand(spent, False, "creep")

    for number in range(int(rng.integers(6, 14))):
        if number:  # a motion to the next posture
            spent = float(rng.uniform(0.6, 3.0))
            step = rng.uniform(-0.8, 0.8, joints) * (rng.random(joints) < 0.8)
            if not step.any():
                step[0] = 0.5
            together = rng.random() < 0.7
            shape = profile(rng)
            for joint in np.flatnonzero(step):
                begin, end = time, time + spent
                if not together:
                    begin, end = np.sort(time + spent * rng.uniform(0, 1, 2))
                    end = min(max(end, begin + 0.3), time + spent)
                    begin = min(begin, end - 0.3)
                    shape = profile(rng)
                motions.append((int(joint), Part(float(begin), float(end), shape), float(step[joint])))
            q = q + step
            time += spent
            if rng.random() < 0.6:  # the tool rings, and comes to rest before the plateau counts
                decay = float(rng.uniform(0.05, 0.25))
                swing = rng.normal(size=3) * rng.uniform(2e-5, 3e-4)
                rings.append((time, swing, decay, float(rng.uniform(4, 15))))
                time += decay * float(np.log(max(np.linalg.norm(swing) / run.sigma, 1.0)))
        what = rng.random()
        if what < 0.2 and number:
            creep()
            continue
        stand(length())
        if what < 0.35:  # right behind a plateau, with no quick motion between
            creep()
        elif what < 0.55:  # a load is hung on
            spent = float(rng.uniform(0.1, 1.0))
            shift = rng.normal(size=3) * rng.uniform(1e-4, 1e-3)
            tool.append((Part(time, time + spent, lambda s: s), shift))
            stand(spent, False, "loading")
            stand(length())
    links = [
        (Rotation.random(random_state=rng).as_matrix(), rng.uniform(-0.5, 0.5, 3)) for _ in range(joints)
    ]
    reach = rng.uniform(0.3, 0.6, 3)
    turned, moved = Rotation.random(random_state=rng).as_matrix(), rng.uniform(-3, 3, 3)
    warming = rng.normal(size=3) * 50e-6 / 3600 * 3  # m/s: some 0.1 mm in an hour
    total = time

    def share(part: Part, t: Array) -> Array:
        s = np.clip((t - part.begin) / (part.end - part.begin), 0.0, 1.0)
        return np.asarray(part.law(s))

    def joint_values(t: Array) -> Array:
        values = np.repeat(begin_q[None], len(t), axis=0)
        for joint, part, amount in motions:
            values[:, joint] += amount * share(part, t)
        return values

    def positions(t: Array, ringing: bool = True) -> Array:
        values = joint_values(t)
        rotation, origin = np.repeat(np.eye(3)[None], len(t), axis=0), np.zeros((len(t), 3))
        for joint, (placed, offset) in enumerate(links):
            origin = origin + rotation @ offset
            c, s = np.cos(values[:, joint]), np.sin(values[:, joint])
            about = np.zeros((len(t), 3, 3))
            about[:, 0, 0], about[:, 0, 1], about[:, 1, 0], about[:, 1, 1] = c, -s, s, c
            about[:, 2, 2] = 1.0
            rotation = rotation @ placed @ about
        point = origin + rotation @ reach
        for part, shift in tool:
            point = point + share(part, t)[:, None] * shift
        for begin, swing, decay, rate in rings if ringing else ():
            since = np.clip(t - begin, 0.0, None)
            point = point + (np.exp(-since / decay) * np.sin(2 * np.pi * rate * since))[:, None] * swing
        return point @ turned.T + moved + warming * t[:, None]

    def moves(t: Array) -> NDArray[np.bool_]:
        step = 1e-3
        drawn = positions(t + step, False) - positions(t - step, False) - 2 * step * warming
        result = np.linalg.norm(drawn, axis=1) > 2 * step * LEAST_SPEED
        for begin, swing, decay, _ in rings:
            size = np.linalg.norm(swing) * np.exp(-np.clip(t - begin, 0.0, None) / decay)
            result |= (t > begin) & (size > RINGING * run.sigma)
        return result

    run.joint_values, run.positions, run.moves = joint_values, positions, moves
    run.slow, run.warming = float(slow_noise), warming
    run.stays.append(Stay(total, total, False, "end"))
    return run


def write(run: Run, folder: Path) -> Path:
    """Write a run as a bag; returns its file."""
    rng = np.random.default_rng([32, run.seed])
    end = run.stays[-1].end
    joint_rate = float(rng.choice([50.0, 100.0, 125.0, 250.0, 500.0]))
    joint_noise = float(np.exp(rng.uniform(np.log(1e-6), np.log(3e-5))))

    def times(rate: float) -> Array:
        jitter = rng.uniform(0.0, 0.15) / rate
        t = np.arange(0.0, end, 1 / rate)
        return np.asarray(np.sort(t + jitter * rng.normal(size=len(t))))

    joint_time = times(joint_rate)
    run.joint_time = joint_time
    q = run.joint_values(joint_time)
    q = q + joint_noise * rng.normal(size=q.shape)
    counts = 1e-5 if rng.random() < 0.4 else 0.0  # of an encoder
    q = np.round(q / counts) * counts if counts else q
    run.joint_sigma = float(np.hypot(joint_noise, counts / np.sqrt(12.0)))
    time = times(run.rate)
    lost = rng.random(len(time)) < 0.01
    for before, after in zip(run.stays[:-1], run.stays[1:], strict=True):  # beams break in motion
        if after.begin - before.end > 0.5 and rng.random() < 0.2:
            gap = rng.uniform(0.1, 0.4)
            at = rng.uniform(before.end + 0.1, after.begin - 0.1)
            lost |= (time > at) & (time < at + min(gap, after.begin - 0.1 - at))
    time = run.time = time[~lost]
    x = run.positions(time)
    noise = rng.normal(size=x.shape)
    if run.slow:  # half of its variance is slow: correlated over some tenths of a second
        run.slow = float(rng.uniform(0.05, 0.3))
        keep = np.exp(-1 / run.rate / run.slow)
        slow = np.zeros_like(noise)
        slow[0] = rng.normal(size=3)
        for at in range(1, len(slow)):
            slow[at] = keep * slow[at - 1] + np.sqrt(1 - keep**2) * rng.normal(size=3)
        noise = np.sqrt(0.5) * (noise + slow)
    x = x + run.sigma * noise
    stamp = time + run.lag_at(time)
    kind = str(rng.choice(["PointStamped", "PoseStamped", "TransformStamped"]))
    names = [f"joint-{one}" for one in rng.permutation(q.shape[1]) + 1]
    efforts = bool(rng.random() < 0.5)
    first = run.form == "bag"
    types = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)

    def make(message_type: str, **values: object) -> object:
        return types.types[message_type](**values)

    def header(t: float, frame: str) -> object:
        nanoseconds = round((EPOCH + t) * 1e9)
        own = {"seq": 0} if first else {}
        time = make("builtin_interfaces/msg/Time", sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        return make("std_msgs/msg/Header", **own, stamp=time, frame_id=frame)

    def joint_message(t: float, values: Array) -> object:
        return make(
            "sensor_msgs/msg/JointState",
            header=header(t, ""),
            name=names,
            position=values,
            velocity=np.zeros(0),
            effort=10 * values if efforts else np.zeros(0),
        )

    def point_message(t: float, place: Array) -> object:
        at = header(t, "tracker")
        own = dict(zip("xyz", map(float, place), strict=True))
        if kind == "PointStamped":
            return make(f"geometry_msgs/msg/{kind}", header=at, point=make("geometry_msgs/msg/Point", **own))
        turn = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=0.0)
        if kind == "PoseStamped":
            pose = make(
                "geometry_msgs/msg/Pose", position=make("geometry_msgs/msg/Point", **own), orientation=turn
            )
            return make(f"geometry_msgs/msg/{kind}", header=at, pose=pose)
        moved = make(
            "geometry_msgs/msg/Transform", translation=make("geometry_msgs/msg/Vector3", **own), rotation=turn
        )
        return make(f"geometry_msgs/msg/{kind}", header=at, child_frame_id="smr", transform=moved)

    path = folder / (f"run{run.seed}.bag" if first else f"run{run.seed}")
    storage = StoragePlugin.MCAP if run.form == "mcap" else StoragePlugin.SQLITE3
    writer = Writer1(path) if first else Writer2(path, version=9, storage_plugin=storage)
    messages = [
        (t + rng.uniform(0.001, 0.02), "/joint_states", joint_message(t, v))
        for t, v in zip(joint_time, q, strict=True)
    ]
    messages += [
        (t + rng.uniform(0.001, 0.05), "/tracker", point_message(s, v))
        for t, s, v in zip(time, stamp, x, strict=True)
    ]
    with writer:
        connections = {
            topic: writer.add_connection(topic, name, typestore=types)
            for topic, name in (
                ("/joint_states", "sensor_msgs/msg/JointState"),
                ("/tracker", f"geometry_msgs/msg/{kind}"),
                ("/chatter", "std_msgs/msg/String"),
            )
        }
        for t, topic, message in sorted(messages, key=lambda one: one[0]):
            name = connections[topic].msgtype
            raw = types.serialize_ros1(message, name) if first else types.serialize_cdr(message, name)
            writer.write(connections[topic], round((EPOCH + t) * 1e9), raw)
    return path if first else next(path.glob(f"*.{run.form}"))


@dataclass
class Score:
    """What was found of a run."""

    lag_error: float  # s, largest over the plateaus
    plateaus: int
    lost: list[str]
    kept: int
    moving: list[str]
    creeps: int
    hidden: int  # kept windows with a motion that no reading can tell
    errors: Array  # (K, 3): of the rows of the table over their sigma
    failed: str = ""


def score(run: Run, path: Path) -> Score:
    """Return what `beamstiff convert` makes of a bag, beside the truth."""
    from beamstiff.errors import BeamstiffError
    from beamstiff.functions.convert import convert_log

    plateaus = [stay for stay in run.stays if stay.still]
    creeps = sum(stay.what == "creep" for stay in run.stays)
    try:
        table = convert_log(path)
    except BeamstiffError as error:
        lost = [f"{stay.end - stay.begin:.2f} s" for stay in plateaus]
        return Score(np.inf, len(plateaus), lost, 0, [], creeps, 0, np.zeros((0, 3)), str(error))
    zero = min(one.time[0] for one in table.signals if one.kind == "joints")
    # the bag begins with its first message; the joints' first reading tells where that is
    begin = run.joint_time[0] - zero
    middles = np.array([0.5 * (stay.begin + stay.end) for stay in plateaus])
    (lag,) = table.lags.values()
    found_lag = lag.lag + lag.drift * (middles - begin - lag.at)
    kept = [(w.start + begin, w.end + begin) for w in table.windows if w.kept]
    lost, moving = [], []
    for stay in plateaus:
        inside = [min(e, stay.end) - max(s, stay.begin) for s, e in kept if s < stay.end and e > stay.begin]
        if max(inside, default=0.0) < LEAST_ROW:
            lost.append(f"{stay.begin:.2f} to {stay.end:.2f} s, covered {max(inside, default=0.0):.2f} s")
    good, true, hidden = [], [], 0
    for s, e in kept:
        t = np.arange(s, e, 5e-3)
        moved = 5e-3 * run.moves(t).sum()
        far = 1e6 * np.ptp(run.positions(t), axis=0).max()
        tells = told(run, s, e) if moved > EDGE else 0.0
        good.append(tells < TOLD)
        hidden += 0.0 < tells < TOLD
        true.append(run.positions(t).mean(axis=0))
        if not good[-1]:
            near = [f"{p.what} {p.begin:.2f} to {p.end:.2f}" for p in run.stays if p.begin < e and p.end > s]
            moving.append(
                f"{s:.2f} to {e:.2f} s ({moved:.2f} s, {far:.0f} um, {tells:.1f} std): {', '.join(near)}"
            )
    rows = np.genfromtxt(table.text.splitlines()[1:], delimiter=",", names=True, deletechars="")
    rows = np.atleast_1d(rows)
    read = np.stack([rows[f"{axis}_[m]"] for axis in "xyz"], axis=1)
    sigma = np.stack([rows[f"sigma_{axis}_[m]"] for axis in "xyz"], axis=1)
    errors = (read - np.array(true)) / sigma if len(read) == len(true) else np.zeros((0, 3))
    worst = float(np.abs(found_lag - run.lag_at(middles)).max())
    return Score(worst, len(plateaus), lost, len(kept), moving, creeps, hidden, errors[np.array(good)])


def told(run: Run, begin: float, end: float) -> float:
    """Return at how many standard deviations readings from `begin` to `end`, s, tell that anything moves."""

    def inside(time: Array) -> Array:
        return time[(time >= begin) & (time <= end)]

    def off(values: Array) -> Array:
        return np.asarray(values - values.mean(axis=0)) if len(values) else values

    joints, time = inside(run.joint_time), inside(run.time)
    squares = float((off(run.joint_values(joints)) ** 2).sum()) / run.joint_sigma**2
    away = off(run.positions(time) - run.warming * time[:, None]) / run.sigma
    noise = np.eye(len(time))
    if run.slow:
        noise = 0.5 * (noise + np.exp(-np.abs(time[:, None] - time) / run.slow))
    return float(np.sqrt(squares + (away * np.linalg.solve(noise, away)).sum()))


def study(seeds: range, show: bool = True) -> list[tuple[Run, Score]]:
    """Return the scores of runs, drawn, written, read and found one by one."""
    found = []
    for seed in seeds:
        run = draw(seed)
        with tempfile.TemporaryDirectory() as folder:
            result = score(run, write(run, Path(folder)))
        found.append((run, result))
        if show and (result.failed or result.lost or result.moving or result.lag_error > 0.01):
            print(
                f"seed {seed} ({run.form}, {run.rate:.0f} Hz, {1e6 * run.sigma:.0f} um"
                f"{', slow noise' if run.slow else ''}): lag {1e3 * result.lag_error:.1f} ms, "
                f"lost {result.lost}, moving {result.moving} {result.failed}"
            )
    return found


def main() -> None:
    """Print what was found of all bags."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bags", type=int, default=200)
    parser.add_argument("--first", type=int, default=1000, help="seed of the first bag")
    options = parser.parse_args()
    found = study(range(options.first, options.first + options.bags))
    scores = [one for _, one in found]
    lags = 1e3 * np.array([one.lag_error for one in scores])
    errors = np.concatenate([one.errors for one in scores])
    forms = Counter(run.form for run, _ in found)
    print(f"{len(found)} bags: {', '.join(f'{count} {form}' for form, count in sorted(forms.items()))}")
    print(f"could not be read: {sum(bool(one.failed) for one in scores)}")
    print(
        f"error of the lag, largest in each bag: median {np.median(lags):.2f} ms, "
        f"95 % {np.quantile(lags, 0.95):.2f} ms, largest {lags.max():.2f} ms (asked 10 ms)"
    )
    lost, moving = sum(len(one.lost) for one in scores), sum(len(one.moving) for one in scores)
    print(f"plateaus planted {sum(one.plateaus for one in scores)}, lost {lost} (asked 0)")
    print(
        f"windows kept {sum(one.kept for one in scores)}, of them moving {moving} (asked 0); with a motion "
        f"that no reading tells at {TOLD:g} standard deviations {sum(one.hidden for one in scores)}; "
        f"creeping stretches planted {sum(one.creeps for one in scores)}"
    )
    print(f"errors of the rows over their sigma: RMS {np.sqrt(np.mean(errors**2)):.2f} (1 is right)")


if __name__ == "__main__":
    main()
