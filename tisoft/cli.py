"""The command line: parse, call, print errors as one sentence."""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from tisoft import stops
from tisoft.errors import TisoftError

COMMANDS = (
    "demo", "run", "render", "check", "bench", "view", "static", "modes", "stability", "sweep",
    "chart", "advise",
)  # fmt: skip

DESCRIPTION = "Soft bodies in Taichi that know how far they can be trusted."
EPILOG = """start with:
  tisoft demo                      a film of a jelly bear, in this folder
  tisoft demo --list               more demos
  tisoft view                      take it in your hand, in the browser
  tisoft check SCENE.toml          what a scene needs, before it runs

exit codes: 0 done, 2 something to mend in the input or on this machine,
            3 the simulation failed, 4 no equilibrium, 130 interrupted,
            128 + n ended by signal n"""


class Parser(argparse.ArgumentParser):
    """Tells a mistake in one sentence."""

    def error(self, message: str) -> NoReturn:
        hint = f"see {self.prog} --help"
        if self.prog == "tisoft" and message.startswith("unrecognized"):
            hint = f"options come after the command, as in tisoft run --json; {hint}"
        self.exit(2, f"tisoft: error: {message}; {hint}\n")


def parser() -> Parser:
    """The whole command line."""
    from tisoft.version import version  # late: importlib.metadata is slow to import

    top = Parser(
        prog="tisoft",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    top.add_argument("--version", action="version", version=f"tisoft {version()}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name in COMMANDS:
        module = import_module(f"tisoft.commands.{name}")
        sub = commands.add_parser(
            name,
            help=module.HELP,
            description=module.HELP[0].upper() + module.HELP[1:] + ".",
            epilog=module.EXAMPLES,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        module.add(sub)
        sub.set_defaults(execute=module.execute)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; returns the exit code."""
    return stops.heeding(lambda: _outcome(arguments), _tell)


def program() -> NoReturn:
    """The process of a command line: what the shell calls."""
    _open_streams()
    code = stops.heeding(lambda: _outcome(None), _tell, last=True)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:  # nobody reads any more; Python would end with a code of its own
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(code)


def _open_streams() -> None:
    """Open streams that the caller has closed (`>&-`), onto nothing: else Python has none, and the
    next file that is opened would get what libraries print.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            nothing = os.open(os.devnull, os.O_RDWR)  # the lowest that is free: mostly this one
            if nothing != number:
                os.dup2(nothing, number)
            setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w"))


def _outcome(arguments: Sequence[str] | None) -> int:
    try:
        with stops.as_stops():
            code = _execute(arguments)
        stops.raise_if_asked()  # a library may have swallowed it
        return code
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        return _explained(error)


def _execute(arguments: Sequence[str] | None) -> int:
    given = sys.argv[1:] if arguments is None else arguments
    if any(word.startswith("--workers") for word in given):
        from tisoft.sweeping.cluster import prepare

        prepare(1)  # they import what they need while this process does
    top = parser()
    options = top.parse_args(arguments)
    if options.command is None:
        top.print_help()
        return 0
    import numpy as np  # late, so that Ctrl-C ends its import in a sentence

    with np.errstate(all="ignore"):  # NumPy's warnings are no sentences for a user
        code = int(options.execute(options))
    sys.stdout.flush()
    return code


def _explained(error: BaseException) -> int:
    """Tell an error in a sentence; returns the exit code.  What is no user's matter is raised."""
    if isinstance(error, SystemExit):
        return error.code if isinstance(error.code, int) else 2
    if isinstance(error, TisoftError):
        return _tell(str(error), error.exit_code)
    if isinstance(error, BrokenPipeError):
        return _end_quietly()
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        return _tell(f"{where}{error.strerror or error}", 2)
    if isinstance(error, MemoryError):
        return _tell("the memory does not suffice; take a coarser mesh or a smaller picture", 2)
    raise error


def _tell(message: str, code: int) -> int:
    with contextlib.suppress(OSError):  # a terminal that was closed
        print(f"tisoft: error: {message.strip().rstrip('.')}", file=sys.stderr, flush=True)
    return code


def _end_quietly() -> int:
    """Whoever read the output has gone; end as other programs do then."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 128 + int(getattr(signal, "SIGPIPE", 13))


if __name__ == "__main__":
    program()
