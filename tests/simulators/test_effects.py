"""Effects of a robot in MuJoCo: the curve over a load cycle is that of `deflect`."""

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.functions.predict import predict
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect
from beamstiff.simulators.assemble import assemble
from beamstiff.simulators.deflection import mujoco_deflection

pytest.importorskip("mujoco")

TORQUE = {"torque": 4000.0}
ANGLES = {"angles": [-1.5, -1.0, -0.5, 0.0, 0.5], "counts": [1.0] * 5, "compliance": 1 / 6.6e6}
PULL = {"largest_stiffness": 4e5, "largest_torque": 3e4}
EFFECTS = [
    ("base-compliance", None, "tilt", {"tilting_compliance": 1e-7}, {}),
    ("tool-compliance", None, "rotation", {"rotational_compliance": 4e-6}, {}),
    ("link-bending", "link2", "uniform", {"bending_flexibility": 1e-7}, {}),
    ("bearing-tilt", "q2", "tilt and radial", {"tilting_compliance": 1e-7, "radial_compliance": 1e-9}, {}),
    ("backlash", "q2", "flank within 0.03", {"half_width": 2e-4}, TORQUE),
    ("hardening", "q2", "knee at 0.25", {"extra_windup": 1e-4}, TORQUE),
    ("hardening", "q2", "cubic", {"softening_at_largest_torque": 1e-4}, TORQUE),
    ("hysteresis", "q2", "friction 0.2", {"held_windup": 2e-4}, TORQUE),
    ("gravity-compensator", "q2", "spring 0.4, free 0, 45 deg", {"largest_stiffness": 4e5}, ANGLES),
    ("gravity-compensator", "q2", "spring 0.4, free 0.8, 270 deg", PULL, ANGLES),
]


def with_effect(name: str, component: str | None, shape: str, parameters: object, scales: object) -> Robot:
    effect = {"effect": name, "shape": shape, "parameters": parameters, "scales": scales}
    robot = load_robot("kr240-2").model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    added = AddedEffect.model_validate(effect | ({"component": component} if component else {}))
    return robot.model_copy(update={"effects": (added,)})


def averaged(name: str, component: str, shapes: dict[str, tuple[float, dict[str, float]]]) -> Robot:
    several = [
        {"shape": shape, "weight": weight, "parameters": parameters, "scales": TORQUE}
        for shape, (weight, parameters) in shapes.items()
    ]
    added = AddedEffect.model_validate({"effect": name, "component": component, "shapes": several})
    return load_robot("kr240-2").model_copy(update={"gravity": (0.0, 0.0, 0.0), "effects": (added,)})


def cycle(robot: Robot) -> Measurements:
    """Return a load that rises, is turned round and rises again in one posture, read beside the TCP too."""
    size = np.concatenate([np.linspace(0, 1, 6), np.linspace(0.8, -1, 10), np.linspace(-0.8, 1, 10)])
    return make_measurements(
        [variable.name for variable in robot.actuated],
        np.tile([0.2, 0.6, -1.2, 0.3, 0.7, 0.1], (len(size), 1)),
        tcp=robot.tcp,
        wrench=size[:, None] * [200, 100, -1900, 50, 30, 20.0],
        pose=[0] * len(size),
        step=np.arange(len(size)),
    )


@pytest.mark.parametrize(("name", "component", "shape", "parameters", "scales"), EFFECTS)
def test_the_curve_over_a_load_cycle(
    name: str, component: str | None, shape: str, parameters: object, scales: object
) -> None:
    check_curve(with_effect(name, component, shape, parameters, scales))


def test_averaged_shapes_act_in_series() -> None:
    friction = {"friction 0.1": (0.4, {"held_windup": 2e-4}), "friction 0.2": (0.6, {"held_windup": 2e-4})}
    flanks = {
        "flank within 0.03": (0.7, {"half_width": 2e-4}),
        "flank within 0.1": (0.3, {"half_width": 4e-4}),
    }
    check_curve(averaged("hysteresis", "q2", friction))
    check_curve(averaged("backlash", "q2", flanks))


def check_curve(robot: Robot) -> None:
    rows = cycle(robot)
    ours, (theirs, lost) = predict(robot, rows, preload=True).displacement, mujoco_deflection(robot, rows)
    assert all("torque right at q2" in line for line in lost)
    without = predict(robot.model_copy(update={"effects": ()}), rows, preload=True).displacement
    for part in (slice(3), slice(3, 6)):
        shown = np.abs(ours - without)[:, part].max()
        gap = np.abs(theirs - ours)[:, part].max()
        assert gap < 0.02 * np.ptp(ours[:, part], axis=0).max()
        assert gap < 0.2 * shown or shown < 0.02 * np.abs(ours[:, part]).max()


def test_what_has_no_counterpart_is_listed() -> None:
    robot = with_effect("load-error", None, "gain", {"gain": 0.01}, {})
    assert any("load-error" in line for line in assemble(robot).lost)
