"""The command line: parse, call, print."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from tisoft.commands import render
from tisoft.errors import TisoftError


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="tisoft")
    commands = parser.add_subparsers(dest="command")
    render.add(commands.add_parser("render"))
    options = parser.parse_args(arguments)
    try:
        return render.execute(options)
    except TisoftError as error:
        print(f"tisoft: error: {error}", file=sys.stderr)
        return error.exit_code


if __name__ == "__main__":
    sys.exit(main())
