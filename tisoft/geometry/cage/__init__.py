"""Cages: lattices of hexahedra around a closed surface, which they carry (NumPy, f64)."""

from tisoft.geometry.cage.build import Cage, cage

__all__ = ["Cage", "cage"]
