"""Soft bodies in real time with Taichi, which know how far they can be trusted."""

import inspect
import os
from importlib import import_module
from typing import TYPE_CHECKING

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")
os.environ.setdefault("TI_ENABLE_PYBUF", "0")
# Taichi asks `inspect` for the line that imports, once for each function that it is to compile.
# Unless the importer is known here, Python looks through all modules each time: .3 s a start.
getattr(inspect, "modulesbyfile", {})["<frozen importlib._bootstrap>"] = "importlib._bootstrap"

if TYPE_CHECKING:
    from tisoft import where
    from tisoft.charting.advice import Advice, advise
    from tisoft.charting.chart import Chart, chart
    from tisoft.errors import Diverged, MeshError, NoEquilibrium, SceneError, TisoftError
    from tisoft.geometry.cage import cage
    from tisoft.geometry.files import read_mesh
    from tisoft.geometry.mesh import SpringNet, TetMesh, tet_mesh
    from tisoft.geometry.shapes import ball, box, cloth, cylinder, grid, net
    from tisoft.geometry.skin import Skin, read_skin, skin
    from tisoft.geometry.surface import read_surface
    from tisoft.models.materials import (
        Linear,
        MassSpring,
        MassTensor,
        NeoHookean,
        ViscoElastic,
    )
    from tisoft.obstacles.shell import read_shell
    from tisoft.region_material import RegionMaterial
    from tisoft.scene import (
        Body,
        Box,
        Camera,
        Capsule,
        Cylinder,
        Load,
        NoContact,
        Pin,
        Plane,
        Probe,
        Render,
        Scene,
        Shell,
        Sphere,
        Torque,
        Turn,
    )
    from tisoft.scene_file import load_scene
    from tisoft.simulation import Frame, Simulation
    from tisoft.sweeping.sweep import Sweep, sweep
    from tisoft.viewer.view import View, view

__all__ = [
    "Advice", "Body", "Box", "Camera", "Capsule", "Chart", "Cylinder", "Diverged", "Frame",
    "Linear", "Load", "MassSpring", "MassTensor", "MeshError", "NeoHookean", "NoContact",
    "NoEquilibrium", "Pin", "Plane", "Probe", "RegionMaterial", "Render", "Scene", "SceneError",
    "Shell", "Simulation", "Skin", "Sphere", "SpringNet", "Sweep", "TetMesh", "TisoftError",
    "Torque", "Turn", "View", "ViscoElastic", "advise", "ball", "box", "cage", "chart", "cloth",
    "cylinder", "grid", "load_scene", "net", "read_mesh", "read_shell", "read_skin",
    "read_surface", "skin", "sweep", "tet_mesh", "view", "where",
]  # fmt: skip

_HOMES = {
    "tisoft.charting.advice": ("Advice", "advise"),
    "tisoft.charting.chart": ("Chart", "chart"),
    "tisoft.errors": ("Diverged", "MeshError", "NoEquilibrium", "SceneError", "TisoftError"),
    "tisoft.geometry.cage": ("cage",),
    "tisoft.geometry.files": ("read_mesh",),
    "tisoft.geometry.mesh": ("SpringNet", "TetMesh", "tet_mesh"),
    "tisoft.geometry.shapes": ("ball", "box", "cloth", "cylinder", "grid", "net"),
    "tisoft.geometry.skin": ("Skin", "read_skin", "skin"),
    "tisoft.geometry.surface": ("read_surface",),
    "tisoft.models.materials": ("Linear", "MassSpring", "MassTensor", "NeoHookean", "ViscoElastic"),
    "tisoft.obstacles.shell": ("read_shell",),
    "tisoft.region_material": ("RegionMaterial",),
    "tisoft.scene": (
        "Body", "Box", "Camera", "Capsule", "Cylinder", "Load", "NoContact", "Pin", "Plane",
        "Probe", "Render", "Scene", "Shell", "Sphere", "Torque", "Turn",
    ),
    "tisoft.scene_file": ("load_scene",),
    "tisoft.simulation": ("Frame", "Simulation"),
    "tisoft.sweeping.sweep": ("Sweep", "sweep"),
    "tisoft.viewer.view": ("View", "view"),
}  # fmt: skip
_HOME = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> object:
    """Names load when first asked for: the command line is there, and heeds Ctrl-C, at once."""
    if name == "where":
        return import_module("tisoft.where")
    if name not in _HOME:
        raise AttributeError(f"module 'tisoft' has no attribute {name!r}")
    if _HOME[name] in ("tisoft.simulation", "tisoft.viewer.view"):
        import_module("tisoft.runtime").import_taichi()
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value


def __dir__() -> list[str]:
    return __all__
