"""Forms of a second author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.forms.author2 import drives, geometry, levers, measurement, outside, structure, tool

MODULES = (drives, geometry, levers, measurement, structure, tool, outside)
FORMS = tuple(form for module in MODULES for form in module.FORMS)
PLACES = outside.PLACES
