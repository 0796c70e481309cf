"""The version of this installation."""

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as _of


def version() -> str:
    """As pyproject.toml says it; "unknown" where tisoft is not installed."""
    try:
        return _of("tisoft")
    except PackageNotFoundError:
        return "unknown"
