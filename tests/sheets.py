"""Scenes of a woven sheet."""

SHEET = """
[[body]]
model = "mass-spring"
young = 1e5
density = 300
thickness = 0.002
[body.mesh]
cloth = {{ size = [1, 1], cells = [{0}, {0}] }}
"""
PIN = """
[[body.pin]]
where = { box = [[-1, -1, -1], [2, 1, 1e-6]] }
"""


def sheet(cells, *, hangs=False):
    """A sheet of 1 m with so many cells along it, which hangs from an edge or falls."""
    return SHEET.format(cells) + (PIN if hangs else "")
