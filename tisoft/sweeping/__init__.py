"""Sweeps: every combination of scene keys, a row each."""
