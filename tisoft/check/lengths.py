"""Lengths in words."""

from __future__ import annotations


def metres(length: float) -> str:
    """A length with a handy unit."""
    for factor, unit in ((1.0, "m"), (1e3, "mm"), (1e6, "µm")):
        if length * factor >= (0.1 if unit == "m" else 1.0):
            return f"{length * factor:.3g} {unit}"
    return f"{length:.3g} m"
