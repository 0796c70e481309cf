"""Linear algebra on one thread: vectors of a body are far too short for more.

Threads of BLAS wait for one another at every dot product, and where another program holds a core
they wait long: a static answer of 11,000 unknowns takes 2 s instead of 5.  Their sums depend on
how many there are as well, and an answer shall not.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any

import scipy.sparse.linalg  # noqa: F401  its BLAS is a library of its own, which must be there


@cache
def _controller() -> Any:
    return import_module("threadpoolctl").ThreadpoolController()


@contextmanager
def one_thread() -> Iterator[None]:
    """BLAS of NumPy and SciPy computes on one thread inside; also a decorator."""
    with _controller().limit(limits=1, user_api="blas"):
        yield
