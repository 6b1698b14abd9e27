"""Forms of a fourth author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.forms.author4 import drives, geometry, measurement, outside, structure

MODULES = (drives, geometry, measurement, structure, outside)
FORMS = tuple(form for module in MODULES for form in module.FORMS)
PLACES = outside.PLACES
