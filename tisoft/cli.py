"""The command line: parse, call, print errors as one sentence."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import NoReturn

import numpy as np

from tisoft.commands.common import INTERRUPTED
from tisoft.errors import TisoftError

COMMANDS = ("demo", "run", "render", "check", "bench", "static", "modes", "stability")

DESCRIPTION = "Soft bodies in Taichi that know how far they can be trusted."
EPILOG = """start with:
  tisoft demo                      a film of a jelly elephant, in this folder
  tisoft demo --list               more demos
  tisoft check SCENE.toml          what a scene needs, before it runs

exit codes: 0 done, 2 something to mend in the input or on this machine,
            3 the simulation failed, 4 no equilibrium, 130 interrupted"""


class Parser(argparse.ArgumentParser):
    """Tells a mistake in one sentence."""

    def error(self, message: str) -> NoReturn:
        hint = f"see {self.prog} --help"
        if self.prog == "tisoft" and message.startswith("unrecognized"):
            hint = f"options come after the command, as in tisoft run --json; {hint}"
        self.exit(2, f"tisoft: error: {message}; {hint}\n")


def parser() -> Parser:
    """The whole command line."""
    top = Parser(
        prog="tisoft",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    top.add_argument("--version", action="version", version=f"tisoft {_version()}")
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


def _version() -> str:
    try:
        return version("tisoft")
    except PackageNotFoundError:
        return "(not installed)"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; returns the exit code."""
    top = parser()
    try:
        options = top.parse_args(arguments)
        if options.command is None:
            top.print_help()
            return 0
        with np.errstate(all="ignore"):  # NumPy's warnings are no sentences for a user
            code = int(options.execute(options))
        sys.stdout.flush()
        return code
    except SystemExit as exit:
        return exit.code if isinstance(exit.code, int) else 2
    except TisoftError as error:
        return _tell(str(error), error.exit_code)
    except KeyboardInterrupt:
        return _tell("interrupted", INTERRUPTED)
    except BrokenPipeError:
        return _end_quietly()
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _tell(f"{where}{error.strerror or error}", 2)
    except MemoryError:
        return _tell("the memory does not suffice; take a coarser mesh or a smaller picture", 2)


def _tell(message: str, code: int) -> int:
    print(f"tisoft: error: {message.strip().rstrip('.')}", file=sys.stderr)
    return code


def _end_quietly() -> int:
    """Whoever read the output has gone; end as other programs do then."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 128 + int(getattr(signal, "SIGPIPE", 13))


if __name__ == "__main__":
    sys.exit(main())
