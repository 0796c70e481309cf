# mypy: ignore-errors
"""Fields of a kind of structure, placed in one tree of their own."""

from collections.abc import Callable
from typing import Any

import taichi as ti


def placer(rows: dict[str, int]) -> tuple[Any, Callable[..., Any]]:
    """The builder of a tree, and field(kind, count, *more): a field in it of numbers or vectors,
    with a row for each of the `rows` of a count, and further axes of these lengths.
    """
    builder = ti.FieldsBuilder()

    def field(kind: Any, count: str, *more: int) -> Any:
        made = kind.field() if hasattr(kind, "field") else ti.field(kind)
        shape = (rows[count], *more)
        builder.dense([ti.i, ti.ij, ti.ijk][len(shape) - 1], shape).place(made)
        return made

    return builder, field
