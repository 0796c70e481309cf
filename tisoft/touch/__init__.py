"""Surfaces that touch: bodies each other, sheets themselves, faces and edges obstacles.

`surface` makes the tables, `fields` holds them, `lists` finds what may come to touch, `rows` tells
gap and direction of a pair, `sweeps` finds the impulses; `touching` is what a scene has of it.
"""
