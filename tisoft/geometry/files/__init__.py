"""Mesh files in and out."""

from tisoft.geometry.files.read import read_mesh
from tisoft.geometry.files.write import write_vtu

__all__ = ["read_mesh", "write_vtu"]
