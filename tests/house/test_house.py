"""How the house stands: sizes, directions of imports, one file a thing."""

import ast
import graphlib
import re
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "tisoft").rglob("*.py"))
MOST_PARAMETERS = 8
LONGEST_SIMULATION = 300
"""Lines of simulation.py."""


def name(file):
    """The module's dotted name."""
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def room(module):
    """The package or file of tisoft that a module belongs to."""
    return ".".join(module.split(".")[:2])


def imported(file):
    """Modules of tisoft that a file imports, wherever in it, those for types alone included."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("tisoft"))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tisoft"):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                path = ROOT / whole.replace(".", "/")
                is_module = path.is_dir() or path.with_suffix(".py").is_file()
                yield whole if is_module else node.module


def test_no_function_has_more_than_eight_parameters():
    wide = []
    for file in FILES:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                a = node.args
                count = len(a.posonlyargs) + len(a.args) + len(a.kwonlyargs)
                if count > MOST_PARAMETERS:
                    wide.append(f"{name(file)}.{node.name}: {count}")
    assert not wide


def test_imports_run_one_way():
    """No room imports another that imports it, types included."""
    edges = defaultdict(set)
    for file in FILES:
        if file.name == "__init__.py" and file.parent.name == "tisoft":
            continue  # the public names, from everywhere
        here = room(name(file))
        edges[here] |= {room(module) for module in imported(file)} - {here, "tisoft"}
    assert list(graphlib.TopologicalSorter(edges).static_order())  # raises CycleError at a circle
    floors = [
        "laws",
        "elements",
        "model",
        "step",
        "equilibrium",
        "stable",
        "present",
        "motion",
        "simulation",
    ]
    for k, floor in enumerate(floors):
        above = {f"tisoft.{other}" for other in floors[k + 1 :]}
        assert not edges[f"tisoft.{floor}"] & above


def test_scenes_are_read_without_taichi():
    for start in ("tisoft.scene", "tisoft.scene_file"):
        seen, todo = set(), [start]
        while todo:
            module = todo.pop()
            if module in seen:
                continue
            seen.add(module)
            path = ROOT / module.replace(".", "/")
            file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
            tree = ast.parse(file.read_text())
            top = [n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)]
            for node in top:
                names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
                assert "taichi" not in names, f"{start} imports {module}, which imports Taichi"
            todo += [m for m in imported_at_top(tree) if m.startswith("tisoft.")]


def imported_at_top(tree):
    """Modules that are imported when the module itself is."""
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tisoft"):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                path = ROOT / whole.replace(".", "/")
                is_module = path.is_dir() or path.with_suffix(".py").is_file()
                yield whole if is_module else node.module


@pytest.mark.parametrize("word", ["_primal", "_lib", "impl.get_runtime", "_ti_core", "taichi.lang"])
def test_no_private_part_of_taichi_is_used(word):
    assert not [name(file) for file in FILES if word in file.read_text()]


def test_the_simulation_is_a_short_file():
    lines = (ROOT / "tisoft/simulation.py").read_text().count("\n")
    assert lines < LONGEST_SIMULATION


def test_a_formula_stands_once():
    """The displacement gradient of a tet, and the elongation of a spring, say."""
    sources = {name(file): file.read_text() for file in FILES}
    for formula in (r"def stress\(H, m\)", r"difference \* rest\[3 \* c \+ d, lane\]"):
        found = [module for module, text in sources.items() if re.search(formula, text)]
        owners = {module.rsplit(".", 1)[0] for module in found}
        assert len(owners) == 1, found


MAP = (ROOT / "docs/lectures.md").read_text(encoding="utf-8")
NAMED = sorted(set(re.findall(r"`(tisoft/[\w/]+\.py)`", MAP)))


def test_the_map_of_the_lectures_names_what_a_substep_is_made_of():
    for needed in ("elements/spring", "elements/tet4", "elements/tensor", "step/substep"):
        assert f"tisoft/{needed}.py" in NAMED
    for folder in ("laws", "elements", "obstacles"):
        for file in (ROOT / "tisoft" / folder).glob("*.py"):
            if file.name not in ("__init__.py", "base.py"):
                assert f"tisoft/{folder}/{file.name}" in NAMED


@pytest.mark.parametrize("path", NAMED)
def test_a_file_of_the_lectures_opens_with_its_equation(path):
    words = ast.get_docstring(ast.parse((ROOT / path).read_text()), clean=False)
    assert words is not None
    equations = [line for line in words.splitlines() if re.search(r"[=≤≥]", line)]
    assert equations, f"{path} opens without an equation"
