"""Forms of a third author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.forms.author3 import drives, levers, measurement, outside, structure

MODULES = (drives, levers, measurement, structure, outside)
FORMS = tuple(form for module in MODULES for form in module.FORMS)
PLACES = outside.PLACES
