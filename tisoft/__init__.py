"""Soft bodies in real time with Taichi, which know how far they can be trusted."""

import os

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")
os.environ.setdefault("TI_ENABLE_PYBUF", "0")

from tisoft import where
from tisoft.errors import Diverged, MeshError, NoEquilibrium, SceneError, TisoftError
from tisoft.geometry.files import read_mesh
from tisoft.geometry.mesh import SpringNet, TetMesh, tet_mesh
from tisoft.geometry.shapes import ball, box, cloth, cylinder, grid, net
from tisoft.geometry.skin import Skin, read_skin, skin
from tisoft.models.materials import (
    Linear,
    MassSpring,
    MassTensor,
    NeoHookean,
    ViscoElastic,
)
from tisoft.scene import (
    Body,
    Box,
    Camera,
    Load,
    Pin,
    Plane,
    Probe,
    Render,
    Scene,
    Sphere,
    Torque,
    Turn,
)
from tisoft.scene_file import load_scene

__all__ = [
    "Body", "Box", "Camera", "Diverged", "Frame", "Linear", "Load", "MassSpring", "MassTensor",
    "MeshError", "NeoHookean", "NoEquilibrium", "Pin", "Plane", "Probe", "Render", "Scene",
    "SceneError", "Simulation", "Skin", "Sphere", "SpringNet", "TetMesh", "TisoftError", "Torque",
    "Turn", "ViscoElastic", "ball", "box", "cloth", "cylinder", "grid", "load_scene", "net",
    "read_mesh", "read_skin", "skin", "tet_mesh", "where",
]  # fmt: skip


def __getattr__(name: str) -> object:
    """Simulation and Frame import Taichi, so they load when first asked for."""
    if name in ("Simulation", "Frame"):
        from tisoft import runtime

        runtime.import_taichi()
        from tisoft import simulation

        return getattr(simulation, name)
    raise AttributeError(f"module 'tisoft' has no attribute {name!r}")
