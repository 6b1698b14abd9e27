"""What places could do: effects at a place lie within its law, and others do not."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.external import POSTURES, clock
from beamstiff.diagnosis.effects.torque_laws import axis_at
from beamstiff.diagnosis.inference.component_subspaces import (
    ASTRAY,
    FADES,
    MODES,
    SOFTENING,
    STOPPED,
    TETHERED,
    UNSTEADY,
    ComponentSubspace,
    _by_posture,
    _remembered,
    component_subspaces,
    modes_of,
)
from beamstiff.diagnosis.inference.library import Library, build_library
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.residual.whitened import Whitened, whiten
from beamstiff.se3 import Array
from tests.diagnosis.machines import POSITION, ROTATION, arm_at, at_random, elbow, kr240, nominal, rows_of

Found = tuple[Baseline, Whitened, Library, list[ComponentSubspace]]


@pytest.fixture(scope="module")
def found() -> Found:
    rows = at_random(kr240(), 60, seed=1, sigma_position=POSITION, sigma_rotation=ROTATION)
    there = nominal(kr240(), rows)
    white = whiten(there)
    library = build_library(there, white)
    return there, white, library, component_subspaces(there, library, white)


def within(law: ComponentSubspace, columns: Array) -> float:
    """Return the share of columns' square that lies in a law's modes."""
    span, _ = np.linalg.qr(law.modes)
    return float(((span.T @ columns) ** 2).sum() / (columns**2).sum())


def signature(found: Found, effect: str, component: str | None, shape: str) -> Array:
    there, white, _, _ = found
    columns = next(one for one in EFFECTS[effect].shapes(there, component) if one.name == shape).columns
    return white.project_out(white.whiten(columns))


def law_at(found: Found, place: str, which: int = 0) -> ComponentSubspace:
    return [law for law in found[3] if law.place == place][which]


def test_every_place_has_a_law_of_as_much_variance(found: Found) -> None:
    there, white, _, laws = found
    places = [law.place for law in laws if law.inside]
    assert places.count("q3") == 2  # its structure and its drive
    assert {"base", "tool", *there.places.links} - {"link0"} <= set(places)  # which stands on the ground
    for law in laws:
        assert (law.modes**2).sum() == pytest.approx(white.gap.size)
        assert law.modes.shape[1] <= MODES
        np.testing.assert_allclose(white.tangent.T @ law.modes, 0, atol=1e-9)


def test_what_is_outside_the_machine_stands_apart(found: Found) -> None:
    outside = {law.place for law in found[3] if not law.inside}
    assert {"load", "readings", "tool point", "q2"} <= outside  # q2: its encoder


@pytest.mark.parametrize(
    ("effect", "component", "shape", "place", "which", "far"),
    [
        ("backlash", "q3", "flank within 0.1", "q3", 1, "q6"),
        ("hardening", "q2", "several knees", "q2", 1, "q1"),
        ("actuator-lever", "q2", "any crank", "q2", 1, "q5"),
        ("bearing-tilt", "q3", "tilt", "q3", 0, "q6"),
        ("base-compliance", None, "tilt", "base", 0, "q5"),
        ("tool-compliance", None, "rotation", "tool", 0, "q1"),
    ],
)
def test_effects_at_a_place_lie_within_its_law(
    effect: str, component: str | None, shape: str, place: str, which: int, far: str, found: Found
) -> None:
    columns = signature(found, effect, component, shape)
    here = within(law_at(found, place, which), columns)
    elsewhere = within(law_at(found, far, which), columns)
    assert here > 0.7
    assert here > elsewhere + 0.2


@pytest.mark.parametrize("absolute", [False, True])
def test_rivals_without_a_name_stand_beside_the_places_that_could_have_them(absolute: bool) -> None:
    pose = np.repeat(np.arange(8), 3)
    q = at_random(kr240(), 8, seed=2).q[pose]
    wrench = 900 * np.random.default_rng(3).standard_normal((24, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    arm = arm_at(q)
    read = {"position": arm.tip, "rotation": Rotation.from_matrix(arm.tool).as_rotvec()} if absolute else {}
    there = nominal(kr240(), rows_of(kr240(), q, wrench, pose=pose, **read))
    white = whiten(there)
    laws = component_subspaces(there, build_library(there, white), white)
    of: dict[str, set[str]] = {}
    for law in laws:
        of.setdefault(law.place, set()).update(law.unmodelled)
    assert STOPPED in of["tool"]
    assert {UNSTEADY, ASTRAY} & of["q2"] == ({UNSTEADY, ASTRAY} if absolute else {UNSTEADY})


def test_a_drive_that_is_another_in_every_posture_has_no_name() -> None:
    some = at_random(elbow(), 12, seed=6)
    pose = np.repeat(np.arange(6), 2)
    there = nominal(elbow(), replace(some, q=some.q[pose], pose=pose))
    axis, each = axis_at(there, "q2"), np.repeat(np.random.default_rng(2).standard_normal(6), 2)
    laws = _by_posture(there, "q2")
    assert list(laws) == [UNSTEADY]  # displacements do not show where it stands
    moved = (axis.shift * (each * axis.load)[:, None]).ravel()
    columns = laws[UNSTEADY].reshape(moved.size, -1)
    assert columns.shape[1] == 6
    left = moved - columns @ np.linalg.lstsq(columns, moved)[0]
    assert np.linalg.norm(left) < 1e-9 * np.linalg.norm(moved)
    assert _by_posture(nominal(elbow(), some), "q2") == {}  # under one load each it could be anything
    more = at_random(elbow(), 2 * POSTURES + 2, seed=6)
    pose = np.repeat(np.arange(POSTURES + 1), 2)
    assert _by_posture(nominal(elbow(), replace(more, q=more.q[pose], pose=pose)), "q2") == {}


@pytest.mark.parametrize("knee", [0.06, 0.3])
def test_a_drive_that_softens_has_no_name_and_one_that_hardens_is_none(knee: float) -> None:
    there = nominal(kr240(), at_random(kr240(), 60, seed=8))
    axis = axis_at(there, "q2")
    over = np.maximum(np.abs(axis.load) - knee * axis.typical, 0.0)
    law = 4e-7 * (axis.shift * (np.sign(axis.load) * over)[:, None])
    noise = there.sigma * np.random.default_rng(9).standard_normal(law.shape)

    def of(gap: Array) -> Mapping[str, Array]:
        seen = replace(there, measured=there.predicted + gap + noise)
        white = whiten(seen)
        laws = component_subspaces(seen, build_library(seen, white), white)
        return {does: modes for one in laws if one.place == "q2" for does, modes in one.unmodelled.items()}

    columns = of(law)[SOFTENING]
    white = whiten(there)
    moved = white.project_out(white.whiten(law[..., None]))
    left = moved - columns @ np.linalg.lstsq(columns, moved)[0]
    assert np.linalg.norm(left) < 0.05 * np.linalg.norm(moved)
    assert SOFTENING not in of(-law)


def test_a_drive_creeps_under_the_weight_too() -> None:
    """By hand, under a torque that stays: after each state the memory is that much nearer to it."""
    heavy = elbow(mass=50.0, gravity=(0.0, -9.81, 0.0))
    rows = rows_of(heavy, [0, 0], [[0.0, 100.0, 0, 0, 0, 0]] * 2, pose=[0, 0])
    rows = replace(rows, time=np.array([0.0, 30.0]))
    there = nominal(heavy, rows)
    axis = axis_at(there, "q2")
    assert axis.dead.all()
    held = _remembered(there, axis, clock(there)).reshape(2, len(FADES), 2)
    for fade, own in zip(FADES, held.transpose(1, 0, 2), strict=True):
        gone = 1.0 - np.exp(-1.0 / fade), 1.0 - np.exp(-2.0 / fade)
        for torque, (first, second) in zip((axis.load, axis.dead), own.T, strict=True):
            assert (first, second) == pytest.approx(np.multiply(gone, torque / axis.typical))


def test_drives_that_carry_nothing_take_nothing_from_the_others() -> None:
    q = at_random(kr240(), 24, seed=5).q
    down = np.tile([0.0, 0.0, -900.0, 0.0, 0.0, 0.0], (24, 1))
    there = nominal(kr240(), rows_of(kr240(), q, down, sigma_position=POSITION, sigma_rotation=ROTATION))
    white = whiten(there)
    laws = component_subspaces(there, build_library(there, white), white)
    assert all(modes.shape[1] for law in laws for modes in law.unmodelled.values())
    for place in ("q1", "q2", "tool"):  # nothing turns the first axis
        assert (modes_of(laws, {place}, white.gap.size) ** 2).sum() == pytest.approx(white.gap.size)


def test_a_link_may_be_called_what_a_place_is_called() -> None:
    arm = elbow()
    other = {"fore": "tool", "upper": "link.1"}
    renamed = tuple(one.model_copy(update={"name": other[one.name]}) for one in arm.rigids)
    arm = arm.model_copy(update={"rigids": renamed})
    there = nominal(arm, at_random(arm, 12, seed=6))
    white = whiten(there)
    library = build_library(there, white)
    link, flange = (law for law in component_subspaces(there, library, white) if law.place == "tool")
    assert TETHERED in flange.unmodelled
    assert TETHERED not in link.unmodelled
    bending = {one.component: one.places for one in library.hypotheses if one.effect == "link-bending"}
    assert bending["link.1"] == ("link.1",)
