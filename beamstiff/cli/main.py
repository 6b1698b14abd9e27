"""The command `beamstiff`."""

from typing import Annotated

import typer

from beamstiff._version import __version__
from beamstiff.cli.calibrate import calibrate
from beamstiff.cli.campaign import campaign
from beamstiff.cli.check import check
from beamstiff.cli.compare import compare
from beamstiff.cli.compare_runs import compare_runs
from beamstiff.cli.compensate import compensate
from beamstiff.cli.convert import convert
from beamstiff.cli.deflect import deflect
from beamstiff.cli.demo import demo
from beamstiff.cli.diagnose import diagnose
from beamstiff.cli.doctor import doctor
from beamstiff.cli.exam import exam
from beamstiff.cli.group import Command, Commands
from beamstiff.cli.identify import identify
from beamstiff.cli.map import map as map_
from beamstiff.cli.options import with_common
from beamstiff.cli.output import STDOUT
from beamstiff.cli.plan import plan
from beamstiff.cli.schema import schema
from beamstiff.cli.show import show
from beamstiff.cli.stiffness import stiffness
from beamstiff.cli.verify import verify

app = typer.Typer(
    name="beamstiff",
    cls=Commands,
    add_completion=True,  # --install-completion, --show-completion
    rich_markup_mode=None,  # examples keep their lines, in pipes too
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"beamstiff {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def beamstiff(
    context: typer.Context,
    _: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Predict robot deflection, identify joint stiffness, find out why the real machine differs.

    ROBOT is always a YAML, URDF or SDF file, or the name of a bundled robot (beamstiff show lists
    them).
    Numbers without a unit are SI: m, rad, N, N m. Wrenches [f, m] and displacements [d, r] are at
    the TCP, in the base frame; r is a rotation vector.

    \b
    To begin with:
      beamstiff show ir663
      beamstiff stiffness ir663 --q q2=10deg,q8=45deg
      beamstiff demo
      beamstiff doctor

    Exit code: 0 success, 2 bad input (one line on stderr says what), 1 a bug in
    beamstiff, 130 after Ctrl-C. An output file is written completely or not at all.
    """
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


MODELLED = (show, stiffness, deflect, identify, calibrate, compare, compare_runs, diagnose, campaign)
USED = (verify, check, plan, map_, compensate, convert, exam, doctor, demo)
for command in (*MODELLED, *USED):  # in the order of --help
    app.command(cls=Command)(with_common(command))
app.command(cls=Command)(with_common(schema, json=STDOUT))
