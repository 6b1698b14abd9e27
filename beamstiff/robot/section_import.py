"""Beam sections of any outline, analysed by the package sectionproperties.

The package is not required, nor an extra of ours: it is MIT, but its mesher (Triangle) is not free for
commercial use. Its x is our local y, its y our local z: Iy = ixx_c (bending in the x-z plane), Iz = iyy_c.
"""

import math
from typing import Any

from beamstiff.errors import BeamstiffError
from beamstiff.robot.sections import Section

ALIGNED = 1e-3  # of the smaller second moment: a product of inertia below is rounding of the mesh


def section_from_analysis(analysed: Any, unit: float, *, shear: bool = False) -> Section:
    """Return the beam section of a cross-section that sectionproperties has analysed.

    `analysed`: after ``calculate_geometric_properties()`` and ``calculate_warping_properties()``; one
        material.
    `unit`: m; length of its unit: ``1e-3`` where its coordinates are in mm.
    `shear`: take over the shear areas, for a Timoshenko beam.

    ::

        geometry = sectionproperties.pre.library.channel_section(d=200, b=75, t_f=12, t_w=6, r=12, n_r=8)
        section = sectionproperties.analysis.Section(geometry.create_mesh(mesh_sizes=20))
        section.calculate_geometric_properties()
        section.calculate_warping_properties()
        Robot(sections={"channel": section_from_analysis(section, unit=1e-3)}, ...)
    """
    if not unit > 0 or not math.isfinite(unit):
        raise BeamstiffError(f"unit: found {unit}, expected the length of its unit in m, such as 1e-3 for mm")
    try:
        area, (ixx, iyy, ixy), torsion = analysed.get_area(), analysed.get_ic(), analysed.get_j()
        along_x, along_y = analysed.get_as() if shear else (None, None)
    except (AttributeError, RuntimeError, AssertionError, TypeError) as error:
        raise BeamstiffError(
            f"the section cannot be used ({str(error)[:120]}): expected sectionproperties' Section of one "
            "material after calculate_geometric_properties() and calculate_warping_properties()"
        ) from None
    if abs(ixy) > ALIGNED * min(ixx, iyy):
        turn = math.degrees(0.5 * math.atan2(-2 * ixy, ixx - iyy))
        raise BeamstiffError(
            f"the section's principal axes are turned by {turn:.4g} deg (ixy = {ixy:.4g}): expected them "
            "along x and y; turn the outline back, and the beam's `up` with it"
        )
    return Section(
        A=area * unit**2,
        Iy=ixx * unit**4,
        Iz=iyy * unit**4,
        J=torsion * unit**4,
        Ay=None if along_x is None else along_x * unit**2,
        Az=None if along_y is None else along_y * unit**2,
    )
