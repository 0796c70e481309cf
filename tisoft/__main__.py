"""python -m tisoft."""

from tisoft.cli import program

program()
