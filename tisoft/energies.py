"""The account of a scene's energy: T + V + G + D − W stays what it was, but for `error`."""

from typing import NotRequired, TypedDict


class Energies(TypedDict):
    """Energies [J]; None for what is not measured."""

    kinetic: float
    """T"""
    elastic: float
    """V"""
    gravity: float
    """G, zero with every node at rest"""
    dissipated: float | None
    """D, by viscosity, damping and contact"""
    external_work: float | None
    """W, of loads and moved pins"""
    error: float | None
    """The imbalance of this account"""
    contact: NotRequired[float]
    """Of D, what impulses between surfaces took; present where some may touch"""
    friction: NotRequired[float]
    """Of D, what friction between surfaces took; present where some may touch"""
