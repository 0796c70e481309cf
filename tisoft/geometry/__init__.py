"""Meshes: generated shapes, files, topology, quality (NumPy only)."""
