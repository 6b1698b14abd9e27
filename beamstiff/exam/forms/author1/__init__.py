"""Forms of the author of the diagnosis: one file an effect, those outside the table in `outside_*`."""

from beamstiff.exam.effect import Effect
from beamstiff.exam.forms.author1 import (
    actuator_lever,
    backlash,
    base_compliance,
    bearing_tilt,
    frame_misalignment,
    geometry_error,
    gravity_compensator,
    hardening,
    hysteresis,
    joint_compliance,
    joint_coupling,
    joint_errors,
    link_bending,
    load_error,
    outliers,
    outside_drives,
    outside_structure,
    payload_error,
    target_slip,
    thermal_drift,
    tool_compliance,
    tool_offset,
)

EFFECTS: tuple[Effect, ...] = tuple(
    module.EFFECT
    for module in (
        link_bending,
        bearing_tilt,
        base_compliance,
        tool_compliance,
        actuator_lever,
        backlash,
        joint_compliance,
        hardening,
        hysteresis,
        joint_coupling,
        gravity_compensator,
        geometry_error,
        tool_offset,
        load_error,
        frame_misalignment,
        payload_error,
        thermal_drift,
        outliers,
    )
)
OUTSIDE: tuple[Effect, ...] = (*outside_drives.EFFECTS, *outside_structure.EFFECTS)
# in the table since the exam of crowded machines, which alone draws them: others keep their cases
LATER: tuple[Effect, ...] = (*joint_errors.EFFECTS, target_slip.EFFECT)
