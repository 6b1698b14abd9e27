"""The fourth author's forms: that they grow with their size, and what holds of their laws."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.exam.campaign import Array, SimulatedCampaign
from beamstiff.exam.designs import Wish, draw_campaign
from beamstiff.exam.effect import Drive
from beamstiff.exam.forms import author4, components, draw_truth, resized
from beamstiff.exam.forms.author4.drives import (
    driven_back,
    eccentric_mesh,
    engaging,
    scissor,
    screw,
    slotted,
    soft_zone,
    spline,
    tooth_friction,
)
from beamstiff.exam.forms.author4.geometry import cardan, dragged
from beamstiff.exam.forms.author4.measurement import BALLS, by_marks, hall
from beamstiff.exam.forms.author4.outside import bedding_in, drum
from beamstiff.exam.forms.author4.structure import bracket, lifting, rubber, short_foot, windowed
from beamstiff.exam.laws import Curved, Law, Situation, curved, posed, winding
from beamstiff.exam.simulate import readings, reality_of
from tests.exam.campaigns import loaded_robot

K = 2e6  # N m/rad
FORMS = [(form.effect, form.name) for form in author4.FORMS]
ABSOLUTE = {
    "geometry-error", "payload-error", "gravity-compensator", "angle-curve", "approach-direction",
    "target-slip",
}  # fmt: skip


@cache
def rich_campaign(name: str, stiff: bool, kind: str) -> tuple[SimulatedCampaign, Array]:
    """Return a campaign, and what a machine without effects reads."""
    wish, robot = Wish("rich", kind, 6, "true"), loaded_robot(name, stiff)
    campaign = replace(draw_campaign(np.random.default_rng(6), robot, wish), shared_unloaded=False)
    return campaign, readings(reality_of(robot, ()), campaign)


@pytest.mark.parametrize("name", ["kr240-2", "ir663"])
@pytest.mark.parametrize(("effect", "form"), FORMS)
def test_a_larger_size_moves_the_readings_more(name: str, effect: str, form: str) -> None:
    stiff = effect == "joint-compliance"
    robot = loaded_robot(name, stiff)
    if not (places := components(robot, effect)):
        assert robot.loops
        assert effect in ("angle-curve", "approach-direction")
        return
    campaign, without = rich_campaign(name, stiff, "absolute" if effect in ABSOLUTE else "displacement")
    truth = draw_truth(np.random.default_rng(3), robot, effect, 0.5, places[0], form)
    moved = []
    for size in (0.2, 0.5, 0.8):
        found = readings(reality_of(robot, (resized(truth, robot, size, 8),)), campaign)
        moved.append(float(np.sqrt(np.mean(np.sum((found - without)[:, :3] ** 2, axis=1)))))
    assert (np.diff(moved) > 0.0).all()


def situation(angle: Array) -> Situation:
    rows = len(angle)
    return Situation({"q": angle}, np.zeros(rows), np.full(rows, 20.0), np.full(rows, 30.0))


def along(law: Law, strains: Array) -> Array:
    """Return the forces of one sample of a law along a way of strains."""
    memory = law.start(1)
    found = []
    for strain in strains:
        force, _, memory = law.respond(np.array([strain]), situation(np.zeros(1)), memory)
        found.append(force[0])
    return np.array(found)


def wound(wind_up: Callable[..., Curved], **p: float) -> Law:
    return winding(partial(wind_up, p, K), K * (1.0 + p.get("gain", 0.0)))


SPLIT = {"sign": -1.0, "preload": 6e-5, "gap": 2e-4, "soft": 0.05}
MESH = {"half_width": 1e-4, "runout": 0.4, "phase": 0.3, "grease": 0.03}
SPRINGS: dict[str, tuple[Law, bool]] = {  # odd or not
    "soft zone": (wound(soft_zone, lost=2e-4, knee=5e-5), True),
    "engaging teeth": (wound(engaging, gain=0.8, scale=2e-4, skew=0.0), True),
    "engaging teeth, skew": (wound(engaging, gain=0.8, scale=2e-4, skew=0.4), False),
    "spline": (spline(K, 1.3, 1e-4), True),
    "scissor gear": (curved(partial(scissor, SPLIT, K)), False),
    "eccentric mesh": (posed(partial(eccentric_mesh, MESH, Drive(load_robot("kr240-2"), "q", K))), True),
    "lifting rim": (lifting(K, 1e-4, 0.4), True),
    "short foot": (short_foot(K, 6e-5), False),
    "rubber": (rubber(K, 6e-5, 0.4), True),
}


@pytest.mark.parametrize("name", SPRINGS)
def test_springs_store_energy_and_tell_their_slope(name: str) -> None:
    law, odd = SPRINGS[name]
    strain = np.linspace(-6e-4, 6e-4, 2401)
    here = situation(np.zeros(len(strain)))
    force, slope, _ = law.respond(strain, here, ())
    middle = len(strain) // 2
    assert abs(force[middle]) < 1e-9 * K
    assert (slope > 0.0).all()
    step = 1e-9
    up, down = (law.respond(strain + way * step, here, ())[0] for way in (1.0, -1.0))
    smooth = np.abs(strain) > 2.0 * step  # at no strain some stiffness jumps
    np.testing.assert_allclose(slope[smooth], ((up - down) / (2.0 * step))[smooth], rtol=2e-4)
    energy = np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(strain))
    assert (energy - energy[middle - 1] >= -1e-12 * K).all()
    assert (np.abs(np.diff(force)) <= 2.0 * K * np.diff(strain)).all()  # no jumps
    assert np.allclose(force, -force[::-1], atol=1e-9 * K) == odd


def toothed(friction: float, reach: float, share: float, arrived: float = 0.0) -> Law:
    p = {"friction": friction, "reach": reach, "share": share, "arrived": arrived}
    return tooth_friction(p, K, "q")


def driven(friction: float, reach: float, power: float, skew: float, arrived: float = 0.0) -> Law:
    p = {"friction": friction, "reach": reach, "power": power, "skew": skew, "arrived": arrived}
    return driven_back(p, K, "q")


FRICTION: dict[str, Law] = {
    "tooth friction": toothed(2e-5, 3e-5, 0.15, arrived=0.4),
    "driven back": driven(4e-5, 4e-5, 1.6, 0.4, arrived=-0.3),
    "drum": drum(1000.0, 200.0, 0.1, 3e-5),
}


@pytest.mark.parametrize("name", FRICTION)
@pytest.mark.parametrize("middle", [0.0, 2e-4])
def test_friction_loses_work_in_a_cycle(name: str, middle: float) -> None:
    way = middle + 2e-4 * np.sin(np.linspace(0.0, 6.0 * np.pi, 3001))
    force = along(FRICTION[name], way)
    work = 0.5 * (force[1:] + force[:-1]) * np.diff(way)
    last = work[2000:].sum()
    assert last == pytest.approx(work[1000:2000].sum(), rel=1e-3)  # the cycle is closed
    assert last > 0.02 * np.ptp(force) * np.ptp(way)


def test_tooth_friction_widens_with_the_torque() -> None:
    law = toothed(1e-5, 1e-5, 0.2)
    way = np.concatenate([np.linspace(0.0, 4e-4, 400), np.linspace(4e-4, 0.0, 400)])
    force = along(law, way)
    at = [np.searchsorted(way[:400], strain) for strain in (1e-4, 3e-4)]
    width = [force[i] - np.interp(way[i], way[:399:-1], force[:399:-1]) for i in at]
    assert width == pytest.approx([2 * K * (1e-5 + 0.2 * strain) for strain in (1e-4, 3e-4)], rel=0.02)


def test_what_is_driven_back_slides_unlike_either_way() -> None:
    law = driven(1e-5, 1e-6, 1.3, 0.5)
    out = along(law, np.linspace(0.0, 1e-3, 200))[-1] - K * 1e-3
    back = along(law, np.linspace(0.0, -1e-3, 200))[-1] + K * 1e-3
    assert out == pytest.approx(1.5 * K * 1e-5, rel=0.01)
    assert back == pytest.approx(-0.5 * K * 1e-5, rel=0.01)


def test_what_beds_in_is_softer_the_second_time_and_loses_work_the_first_time_only() -> None:
    there = np.linspace(0.0, 3e-4, 301)
    cycle = np.concatenate([there, there[::-1]])
    law = bedding_in({"softer": 0.4, "from_": 1e-4}, K, "q")
    force = along(law, np.concatenate([cycle, cycle]))
    first, back, again = force[:301], force[301:602], force[602:903]
    np.testing.assert_allclose(again, back[::-1])
    assert (first[1:-1] > again[1:-1]).all()
    assert first[-1] == again[-1]
    strain = np.linspace(1e-6, 6e-4, 500)
    start = (np.zeros(500),)
    f, slope, _ = law.respond(strain, situation(strain), start)
    np.testing.assert_allclose(slope, np.gradient(f, strain), rtol=0.02)
    assert (slope > 0.0).all()


def test_a_windowed_link_gives_as_its_pieces_in_series() -> None:
    profile = windowed(1e6, 1.2, (0.3, 0.6), np.array([1.0, 9.0, 1.0, 4.0, 2.0, 1.0]))
    total = profile.compliance.sum(axis=0)
    assert total[5] * 1.2 == pytest.approx(1e-6)  # bending over the length
    assert total[4] / total[5] == pytest.approx(0.7 + 0.3 * 2.0)
    assert total[1] / total[2] == pytest.approx(0.7 + 0.3 * 9.0)


def test_a_bracket_is_a_spring_and_straight_it_is_a_cantilever() -> None:
    p = {"bending": 1e6, "aside": 0.2, "ahead": 0.3, "way": 0.7, "flat": 0.4, "twist": 0.5}
    compliance = bracket(p)
    np.testing.assert_allclose(compliance, compliance.T, atol=1e-12 * compliance.max())
    assert np.linalg.eigvalsh(compliance)[0] > 0.0
    straight = bracket({**p, "aside": 1e-9, "way": 0.0})
    EI = 1e6 * 0.3
    # the broad side's normal is that of the corner: bending about it is stiff, the other way weak
    assert sorted(np.diag(straight)[3:]) == pytest.approx(
        sorted([0.3 / EI, 0.3 / (0.4 * EI), 0.3 / (0.5 * EI)])
    )
    assert sorted(np.diag(straight)[:2]) == pytest.approx(
        [0.3**3 / (3 * EI), 0.3**3 / (3 * 0.4 * EI)], rel=5e-3
    )


@pytest.mark.parametrize("way", [0.4, 1.3, 2.2])
def test_levers_are_the_square_of_the_actuators_rate(way: float) -> None:
    step = 1e-6

    def rate(length: Callable[[float], float], angle: float) -> float:
        return (length(angle + step) - length(angle - step)) / (2.0 * step)

    def long(angle: float) -> float:
        return float(np.sqrt(1.0 + 0.4**2 - 0.8 * np.cos(angle)))

    found = screw(np.array([way]), 0.4, 1.5)[0]
    assert found == pytest.approx(rate(long, way) ** 2 / (1.0 + 1.5 * long(way)))
    assert slotted(np.array([0.3 * way]))[0] == pytest.approx(
        rate(lambda a: float(np.tan(a)), 0.3 * way) ** 2
    )


def test_errors_of_joints_and_frames_follow_their_closed_forms() -> None:
    angle = np.linspace(-7.0, 7.0, 501)
    ahead = cardan(angle, 0.05, 0.3)
    np.testing.assert_allclose(ahead, 0.05**2 / 4.0 * np.sin(2.0 * (angle - 0.3)), atol=2e-6)
    p = {"way": 0.1, "start": 0.2, "forward": 0.8, "back": 0.4}
    moves = np.array([0.0, 1.0, 1.05, 0.95, -1.0, -1.0])
    long = dragged(moves, "long-seal", p)
    assert long[0] == 0.2
    assert long[1] == pytest.approx(1.0, abs=1e-4)
    assert long[3] == pytest.approx(-1.0 + 2.0 * np.exp(-1.0), abs=1e-4)
    assert long[4] == long[5] == pytest.approx(-1.0, abs=1e-4)
    np.testing.assert_array_equal(dragged(moves, "unequal", p), [0.2, 0.8, 0.8, -0.4, -0.4, -0.4])
    turned, shift = by_marks(np.cross([1e-3, -2e-3, 3e-3], BALLS) + np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(turned, [1e-3, -2e-3, 3e-3])
    np.testing.assert_allclose(shift, [0.1, 0.2, 0.3])


def test_a_halls_temperature_is_periodic_and_does_not_jump() -> None:
    time = np.linspace(0.0, 3600.0, 7201)
    cold = hall(time, 1800.0, 0.2, 0.3)
    assert 0.0 < cold.min() < 0.1 < 0.7 < cold.max() < 1.0
    np.testing.assert_allclose(cold[:3600], cold[3600:-1], atol=1e-12)
    assert np.abs(np.diff(cold)).max() < 2e-3
