"""`compare`: every model of elasticity fitted to the same rows and judged by held-out ones."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from beamstiff.diagnosis.residual.baseline import fitted_names
from beamstiff.diagnosis.without_effects import without_effects
from beamstiff.errors import OptionError, shown
from beamstiff.functions.checks import names_of, whole, without_model
from beamstiff.functions.robots import as_robot
from beamstiff.identification.assembly_plausibility import displacement_doubts
from beamstiff.identification.models.side_by_side import FITS, Models, Options, fit_models
from beamstiff.identification.models.split import split_rows
from beamstiff.measure.coerce import DataLike, as_tables, doubted, doubts_of
from beamstiff.measure.rows import concatenate, require_tracker
from beamstiff.robot.reader import RobotLike


def compare(
    robot: RobotLike,
    data: DataLike,
    parameters: Sequence[str] | None = None,
    *,
    models: Sequence[str] | None = None,
    share: float = 0.25,
    fit_load: float | None = None,
    cube: float | None = None,
    seed: int = 0,
    separate: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Models:
    """Fit every model of elasticity to the same rows, and judge each by held-out rows.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
        What its `effects` displace is taken off the readings first.
    data : Measurements or path, or several
        Displacements of the TCP under loads there.
    parameters : sequence of str, optional
        Stiffness values that are fitted, and may vary; default ``robot.identify``.
    models : sequence of str, optional
        "rigid", "nominal", "parametric", "fuzzy", "grid", "gray box", "gaussian process";
        default all.
    share : float
        Of the poses to hold out.
    fit_load : float, optional
        Fit to rows of this load alone, N, hold all others out; default: hold the largest load out.
    cube : float, optional, m
        Side of the grid's cubes; default a third of the workspace.
    seed : int
        Of all that is drawn at random.
    separate : bool
        As published: every cube by its own rows alone, every fuzzy compliance term with its own partition.
    progress : callable, optional
        Called with the name of the model that is fitted next.

    Returns
    -------
    Models

    Raises
    ------
    BeamstiffError
        When there is no such model or parameter, the rows are no displacements of the TCP, or they carry no
        model at all.
    """
    machine, dropped = without_model(as_robot(robot), "the comparison, nor of what it writes")
    whole("seed", seed, 0)
    if cube is not None and not 0 < cube < float("inf"):
        raise OptionError("cube", f"found {shown(cube)}, expected a length in m above 0")
    names = names_of("models", models) or list(FITS)
    chosen = names_of("parameters", parameters)
    tables = as_tables(data, machine)
    doubts = doubts_of(machine, tables)
    options = Options(None if chosen is None else tuple(chosen), cube, seed, separate)
    every = concatenate(tables)
    require_tracker(every, "compare")
    doubts += displacement_doubts(machine, every, chosen or fitted_names(machine))
    with doubted(doubts):
        bare, rows = without_effects(machine, every)
        found = fit_models(bare, rows, split_rows(rows, share, fit_load, seed), names, options, progress)
    return replace(found, robot=machine, notes=(*doubts, *dropped))
