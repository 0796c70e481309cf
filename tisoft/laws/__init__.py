"""Stress laws, one file each; `LAWS` has a line for each, by the model's word in a scene.

A law is a file with a class (`base` lists its members) and its line here: scene files, the Python
API, statics, modes, the stable step and the measures then know it.  Modules load when a scene needs
them, so that scene files are read without Taichi.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

LAWS = {
    "linear": "tisoft.laws.linear.Linear",
    "viscoelastic": "tisoft.laws.st_venant.StVenant",
    "neo-hookean": "tisoft.laws.neo_hookean.NeoHookean",
}
"""Word of the model: module and class of its law."""


def law(word: str) -> Any:
    """The law's class."""
    module, name = LAWS[word].rsplit(".", 1)
    return getattr(import_module(module), name)
