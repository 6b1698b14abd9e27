"""Forms of a second author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.components import nowhere
from beamstiff.exam.forms.author2 import drives, measurement, structure
from beamstiff.exam.machine import drives_of

FORMS = tuple(form for module in (drives, measurement, structure) for form in module.FORMS)
PLACES = {"uneven-drive": drives_of, "softening-drive": drives_of, "tether": nowhere}  # outside the table
