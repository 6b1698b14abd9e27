"""The IR-663 of seed 003 for a study of geometric calibration: 43 parameters, 27 poses, published errors."""

from __future__ import annotations

import csv
import itertools
import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from beamstiff import Robot, load_robot
from beamstiff.calibration.corrected import corrected
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array, rotation_about, rotation_from_vector, transform, vector_from_rotation

HERE = Path(__file__).resolve().parent
SHARED = HERE.parent / os.environ.get("BEAMSTIFF_SHARED", "../shared")
ROBOT = HERE.parent / "examples" / "data" / "ir663_wrist.yaml"
# the paper's names (appendix B) and those of the file
NAMES = {
    **{"alpha1": "f1.alpha", "d1": "f1.d", "theta1": "q1", "r1": "f1.r"},
    **{"alpha2": "carrier.alpha", "d2": "carrier.d", "r2": "carrier.r"},
    **{"screw_r2": "screw2", "kappa2": "lug2.gamma", "lambda2": "pivot2.gamma"},
    **{"l12": "lug2.d", "l32": "pivot2.d"},
    **{"beta3": "lean3.beta", "alpha3": "f3.alpha", "d3": "f3.d", "r3": "f3.r"},
    **{"alpha4": "f4.alpha", "d4": "f4.d", "theta4": "q4", "r4": "f4.r"},
    **{"alpha5": "f5.alpha", "d5": "f5.d", "theta5": "q5", "r5": "f5.r"},
    **{"alpha6": "f6.alpha", "d6": "f6.d", "r6": "f6.r"},
    **{"alpha7": "f7.alpha", "d7": "f7.d", "theta7": "q7", "r7": "f7.r"},
    **{"betaE": "fE.beta", "alphaE": "fE.alpha", "dE": "fE.d", "rE": "fE.r"},
    **{"screw_r8": "screw8", "kappa8": "lug8.gamma", "lambda8": "pivot8.gamma"},
    **{"l18": "lug8.d", "l38": "pivot8.d", "d9": "f9.d", "d10": "f10.d", "d11": "f11.d"},
}
PAPERS = {name: paper for paper, name in NAMES.items()}
HELD = ("kappa8", "kappa2", "screw_r8", "d9", "r2", "r7")  # not identifiable independently, by the paper
POSITION, ORIENTATION = (
    3.7e-5,
    1.7e-4,
)  # m, rad: one point of the paper's camera, and three of them 0.3 m apart
TILT = np.radians(60)  # of the tool from level, at most; ours: the paper does not print its orientations


@dataclass(frozen=True)
class Published:
    """What the paper prints: combinations of C.1 and errors of C.2 to C.11 (SI, the file's names)."""

    combinations: dict[str, dict[str, float]]
    errors: dict[str, float]


@cache
def ir663() -> Robot:
    """Return the robot with wrist and screws."""
    return load_robot(ROBOT)


def published() -> Published | None:
    """Return the paper's figures, or None where the shared data are missing."""
    folder = SHARED / "data"
    if not (folder / "ir663_dependent_parameters.csv").exists():
        return None
    combinations: dict[str, dict[str, float]] = {}
    for line in _lines(folder / "ir663_dependent_parameters.csv"):
        combinations.setdefault(line["dependent"], {})[line["identified"]] = float(line["coefficient"])
    errors = {}
    for line in _lines(folder / "ir663_geometric_errors.csv"):
        if line["value"]:
            angle = line["parameter"].startswith(("alpha", "beta", "theta", "kappa", "lambda"))
            factor = np.pi / 180 if angle else 1e-3
            errors[NAMES[line["parameter"]]] = factor * float(line["value"])
    return Published(combinations, errors)


def _lines(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def workspace(count: int | None, seed: int = 0, tilt: float = TILT) -> Array:
    """Return poses (P, 4, 4) in the volume of eq. 59: its 27 grid points, or so many at random."""
    rng = np.random.default_rng([seed, 3])
    place = np.array(list(itertools.product((1.4, 1.75, 2.1), (-0.3, 0.0, 0.3), (1.4, 1.55, 1.7))))
    if count is not None:
        place = rng.uniform((1.4, -0.3, 1.4), (2.1, 0.3, 1.7), (count, 3))
    forward = rotation_about(1, np.full(len(place), np.pi / 2))  # the tool's axis along x
    return transform(rotation_from_vector(tilt * rng.uniform(-1, 1, place.shape)) @ forward, place)


@cache
def joint_readings(count: int | None = None, seed: int = 0, tilt: float = TILT) -> Array:
    """Return joint readings (P, 6) where the nominal robot is in these poses, random ones within reach."""
    found = inverse_geometry(
        compile_kinematics(ir663()), workspace(2 * (count or 0) or None, seed, tilt), seed=0
    )
    if int(found.reached.sum()) < (count or len(found.q)):
        raise RuntimeError(f"{(~found.reached).sum()} poses are out of reach")
    return found.q[found.reached][:count]


def readings(real: Robot, q: Array, noise: float, seed: int) -> Measurements:
    """Return measured poses of a robot; `noise` 1 is the camera's."""
    rng = np.random.default_rng([seed, 5])
    kinematics = compile_kinematics(real)
    pose = pose_of(kinematics, posture(kinematics, q), real.tcp)
    turn = rotation_from_vector(noise * ORIENTATION * rng.standard_normal((len(q), 3)))
    return make_measurements(
        [variable.name for variable in real.actuated],
        q,
        tcp=real.tcp,
        position=pose[:, :3, 3] + noise * POSITION * rng.standard_normal((len(q), 3)),
        rotation=vector_from_rotation(turn @ pose[:, :3, :3]),
        sigma_position=POSITION,
        sigma_rotation=ORIENTATION,
    )


def machine(errors: dict[str, float]) -> Robot:
    """Return the robot with geometric errors."""
    return corrected(ir663(), errors, joint_readings()[:1])
