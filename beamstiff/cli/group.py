"""How every command ends: exit codes, and one line on stderr instead of a traceback."""

import errno
import os
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

from typer.core import TyperCommand, TyperGroup

from beamstiff.cli.output import TYPED, say, silence
from beamstiff.errors import BeamstiffError, OptionError

# of a stream: files that commands write or read say for themselves what is wrong with them
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
SUCCESS, FAILURE, REFUSED, INTERRUPTED = 0, 1, 2, 130
# Many small matrices: threads inside the linear algebra get in one another's way, twenty times slower on a
# busy machine. Read when the library loads, which no command has done yet; what the user has set stays.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

# arguments of functions whose option on the command line has another name
CALLED = {"components": "use", "fixed": "fix", "ties": "tie", "bounds": "bound", "priors": "prior"}


class Command(TyperCommand):
    """A command whose options take no other option for their value."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read what was typed: ``--names --out FILE`` would have taken ``--out`` for a name."""
        valued = {
            name: one
            for one in self.get_params(ctx)
            if one.param_type_name == "option" and not getattr(one, "is_flag", False)
            for name in one.opts
        }
        for option, value in pairwise(args):
            if option in valued and value.startswith("--"):
                wanted = valued[option].metavar or "a value"
                raise BeamstiffError(f"{option}: expected {wanted}, found the option {value}")
        return super().parse_args(ctx, args)


class Commands(TyperGroup):
    """Commands that end with 0 on success, 2 on bad input, 1 on a fault of ours, 130 on Ctrl-C."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run a command and exit."""
        for name in THREADS:
            os.environ.setdefault(name, "1")
        for stream in (sys.stdout, sys.stderr):
            if hasattr(stream, "reconfigure"):  # an old code page shows a `?` for a sign that it lacks
                stream.reconfigure(errors="replace")
        arguments = sys.argv[1:] if args is None else list(args)
        TYPED.set(arguments)
        try:
            code = super().main(
                args=args,
                prog_name=prog_name,
                complete_var=complete_var,
                standalone_mode=False,
                windows_expand_args=windows_expand_args,
                **extra,
            )
            sys.stdout.flush()
        except KeyboardInterrupt:
            code = INTERRUPTED
        except Exception as error:  # whatever it is, people get one line
            with _unless_nobody_can_be_told():
                code = REFUSED if isinstance(error, BeamstiffError) or _no_room(error) else FAILURE
                code = _explain(error, debug="--debug" in arguments)
        with _unless_nobody_can_be_told():
            if code == INTERRUPTED:
                say("interrupted")
            sys.stderr.flush()
        if not standalone_mode:
            return code
        sys.exit(code if isinstance(code, int) else SUCCESS)


@contextmanager
def _unless_nobody_can_be_told() -> Iterator[None]:
    """Pass over a stderr that takes nothing (a full disk): the exit code is left to tell."""
    try:
        yield
    except OSError:
        silence(sys.stderr)


def _explain(error: Exception, debug: bool) -> int:
    """Say in one line what went wrong, and return the exit code."""
    if debug:
        traceback.print_exception(error)
    if isinstance(error, BeamstiffError):
        say(f"error: {_told(error)}")
        return REFUSED
    if hasattr(error, "format_message"):  # typer's own: what was typed is no valid command
        say(f"error: {_usage(error)}")
        return REFUSED
    if _no_room(error):
        silence(sys.stdout)  # what is left in its buffer would be tried again at the end
        say(f"error: stdout: cannot be written: {str(getattr(error, 'strerror', None) or error).lower()}")
        return REFUSED
    if isinstance(error, MemoryError):
        say("error: not enough memory for a robot or table of this size")
        return FAILURE
    what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    more = "" if debug else "; --debug shows where it happened"
    say(
        f"internal error: {what}: a fault of beamstiff, please report it with the command and its files{more}"
    )
    return FAILURE


def _no_room(error: Exception) -> bool:
    """Tell whether stdout takes nothing more."""
    return isinstance(error, OSError) and error.filename is None and error.errno in NO_ROOM


def _told(error: BeamstiffError) -> str:
    """Return what is wrong, options by their names on the command line."""
    if not isinstance(error, OptionError):
        return str(error)
    return f"--{CALLED.get(error.option, error.option).replace('_', '-')}: {error.what}"


def _usage(error: Any) -> str:
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "beamstiff"
    return f"{error.format_message().rstrip('. ')} (see {command} --help)"
