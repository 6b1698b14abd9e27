"""Forms of the author of the diagnosis."""

from beamstiff.exam.components import nowhere
from beamstiff.exam.forms.author1 import drives, geometry, levers, measurement, outside, structure, tool
from beamstiff.exam.machine import components_of, drives_of

_MODULES = (structure, tool, levers, drives, geometry, measurement, outside)
FORMS = tuple(form for module in _MODULES for form in module.FORMS)
PLACES = {
    "link-bending": structure.links, "bearing-tilt": components_of, "base-compliance": nowhere,
    "tool-compliance": nowhere, "tool-offset": nowhere,
    "actuator-lever": levers.rod_drives, "gravity-compensator": levers.balanced_axes,
    "backlash": drives_of, "joint-compliance": drives.rigid_joints, "hardening": drives_of,
    "hysteresis": drives_of, "joint-coupling": drives.coupled_drives,
    "geometry-error": geometry.geometry_places, "payload-error": nowhere,
    **dict.fromkeys(("load-error", "frame-misalignment", "thermal-drift", "outliers"), nowhere),
    "angle-curve": geometry.turning_axes, "approach-direction": geometry.turning_axes,
    "target-slip": tool.reflectors,
    **outside.PLACES,
}  # fmt: skip
