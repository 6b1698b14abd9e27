"""Forms of a fourth author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.forms.author4 import (
    drives,
    ends,
    geometry,
    joint_errors,
    levers,
    measurement,
    outside,
    structure,
)

MODULES = (drives, ends, geometry, levers, measurement, structure, outside, joint_errors)
FORMS = tuple(form for module in MODULES for form in module.FORMS)
PLACES = outside.PLACES
