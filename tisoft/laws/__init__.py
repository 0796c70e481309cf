"""Stress laws, one file each; `LAWS` has a line for each, by the model's word in a scene.

The modules load when a scene needs them: scene files are read without Taichi.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

LAWS = {
    "linear": "linear.Linear",
    "viscoelastic": "st_venant.StVenant",
    "neo-hookean": "neo_hookean.NeoHookean",
}
"""Word of the model: module and class of its law."""


def law(word: str) -> Any:
    """The law's class (`base` lists what it has)."""
    module, name = LAWS[word].split(".")
    return getattr(import_module(f"tisoft.laws.{module}"), name)
