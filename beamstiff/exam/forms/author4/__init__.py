"""Forms of a fourth author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.forms.author4 import drives, geometry, measurement, outside, structure

FORMS = tuple(form for module in (drives, geometry, measurement, structure, outside) for form in module.FORMS)
PLACES = outside.PLACES
