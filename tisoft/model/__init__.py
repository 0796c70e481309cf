"""Scenes as Taichi fields: nodes, blocks of cells, and how bodies are numbered."""
