"""Forms of a third author, who has not read the diagnosis; who writes the diagnosis must not read these.

What is not cited is known from practice or from any textbook of machine elements, mechanisms, angle
measurement or strength of materials; sizes are engineering estimates where no source is given.
"""

from beamstiff.exam.forms.author3 import drives, levers, measurement, outside, structure

FORMS = tuple(form for module in (drives, levers, measurement, structure, outside) for form in module.FORMS)
PLACES = outside.PLACES
