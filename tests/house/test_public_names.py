"""Every public name says what it is: words, units, shapes, errors, sources; and has types."""

import ast
import dataclasses
import inspect
import re
import textwrap

import pytest

import tisoft as ts
from tisoft.equilibrium.modes import Modes
from tisoft.equilibrium.statics import Equilibrium
from tisoft.measures.elements import CellMeasures, SpringMeasures
from tisoft.measures.measures import Measures
from tisoft.models.materials import MODELS

RETURNED = {c.__name__: c for c in (Equilibrium, Modes, Measures, CellMeasures, SpringMeasures)}
"""What methods of public names return."""
SELECTIONS = {f"where.{name}": getattr(ts.where, name) for name in (
    "box", "everything", "named_set", "nearest", "nodes", "plane", "region",
)}  # fmt: skip
NAMES = {**{n: getattr(ts, n) for n in ts.__all__ if n != "where"}, **RETURNED, **SELECTIONS}
PLAIN = {
    *("poisson", "damping_ratio", "friction", "load_factor", "strain", "volume_ratio"),
    *("least_ratio", "weights", "up", "normal", "axis"),
}
"""Numbers without a unit."""


def members(cls):
    """Public methods and properties that tisoft itself wrote, by name."""
    for base in cls.__mro__:
        if base.__module__.startswith("tisoft"):
            for name, value in vars(base).items():
                is_one = inspect.isfunction(value) or isinstance(value, property | staticmethod)
                if is_one and not name.startswith("_"):
                    yield f"{base.__qualname__}.{name}", value


def functions():
    """Every public function and method, with its qualified name."""
    for name, value in NAMES.items():
        if inspect.isclass(value):
            for qualified, member in members(value):
                inner = getattr(member, "fget", None) or getattr(member, "__func__", member)
                if "a Taichi function" not in (inner.__doc__ or ""):
                    yield qualified, inspect.unwrap(inner)
        else:
            yield name, value


FUNCTIONS = dict(functions())
CLASSES = {name: value for name, value in NAMES.items() if inspect.isclass(value)}
DATA = {name: cls for name, cls in CLASSES.items() if dataclasses.is_dataclass(cls)}


def words_of_fields(cls):
    """What is said of each field: in the class's Args, or under the field itself."""
    told = {}
    for base in reversed(cls.__mro__):
        if not base.__module__.startswith("tisoft"):
            continue
        text = inspect.cleandoc(base.__doc__ or "")
        for match in re.finditer(r"^ {4}([\w, ]+): (.*(?:\n {8}.*)*)", text, re.MULTILINE):
            told.update(dict.fromkeys(match[1].split(", "), match[2]))
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        for field, after in zip(tree.body, tree.body[1:], strict=False):
            if isinstance(field, ast.AnnAssign) and isinstance(after, ast.Expr):
                told[field.target.id] = ast.literal_eval(after.value)
        for name in re.findall(r"`(\w+)`", text):
            told.setdefault(name, text)
    return told


@pytest.mark.parametrize("name", sorted({**CLASSES, **FUNCTIONS}))
def test_it_has_words_of_its_own(name):
    thing = {**CLASSES, **FUNCTIONS}[name]
    words = thing.__doc__
    assert words, name
    assert not words.startswith(f"{thing.__name__}("), f"{name} has its signature alone"


@pytest.mark.parametrize("name", sorted(DATA))
def test_every_field_is_explained_numbers_with_their_unit(name):
    told = words_of_fields(DATA[name])
    for field in dataclasses.fields(DATA[name]):
        if field.name.startswith("_"):
            continue
        assert field.name in told, f"{name}.{field.name}"
        kind = str(field.type)
        if ("float" in kind or "Floats" in kind or "Vector" in kind) and field.name not in PLAIN:
            assert "[" in told[field.name], f"{name}.{field.name} has no unit"
        if "Floats" in kind or "NDArray" in kind:
            assert "shape" in told[field.name], f"{name}.{field.name} has no shape"


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_arrays_have_a_shape_errors_are_told_and_types_are_whole(name):
    function = FUNCTIONS[name]
    words, kinds = function.__doc__ or "", inspect.get_annotations(function)
    if re.search("Floats|NDArray|Ints", str(kinds.get("return"))):
        assert re.search("shape|Rows|rows", words), f"{name} does not say the array's shape"
    if re.search(r"^\s+raise \w*Error", inspect.getsource(function), re.MULTILINE):
        assert re.search("Raises|raises", words), f"{name} does not say which errors it raises"
    wanted = [p for p in inspect.signature(function).parameters if p != "self"]
    assert "return" in kinds and set(wanted) <= set(kinds), f"{name} lacks type hints"


@pytest.mark.parametrize("name", sorted(DATA))
def test_what_checks_its_input_says_what_it_raises(name):
    checks = "__post_init__" in {n for base in DATA[name].__mro__ for n in vars(base)}
    if checks:
        told = any("Raises" in (base.__doc__ or "") for base in DATA[name].__mro__)
        assert told, f"{name} does not say what it raises"


def test_models_name_their_source():
    for model in set(CLASSES.values()) & set(MODELS.values()):
        assert re.search(r"\b(18|19|20)\d\d\b", model.__doc__), model
