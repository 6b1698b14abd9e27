"""Forms of a second author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.forms.author2 import drives, measurement, outside, structure

FORMS = tuple(form for module in (drives, measurement, structure, outside) for form in module.FORMS)
PLACES = outside.PLACES
