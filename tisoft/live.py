"""Objects of a scene, each value checked where it enters, with the sentence that a scene file gets.

A `Live` object declares a check for every attribute that may be set; its lists are `Items`, which
check what is put into them.  What is `frozen` is checked once, when it is made, and says so when
somebody wants to change it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, ClassVar, NoReturn, SupportsIndex, TypeVar

from tisoft import checks
from tisoft.checks import FieldError

Check = Callable[[str, Any], Any]
"""Of a field's name and a value; returns what is kept, or raises FieldError."""
Part = TypeVar("Part")
Kind = TypeVar("Kind", bound=type)


class Live:
    """An object whose attributes are checked when they are set, and that has no others."""

    _checks: ClassVar[Mapping[str, Check]]
    """Of each attribute."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self._checks:
            hint = checks.suggestion(name, self._checks)
            raise FieldError(name, f"is nothing that a {type(self).__name__} has; {hint}", value)
        object.__setattr__(self, name, self._checks[name](name, value))


class Items(list[Part]):
    """A list whose members are of one kind."""

    kinds: ClassVar[tuple[type, ...]]
    words: ClassVar[str]
    """The kind, in a sentence."""
    field: ClassVar[str]
    """What a member is called."""

    def __init__(self, items: Iterable[Any] = ()) -> None:
        super().__init__(self._all(items, 0))

    @classmethod
    def of(cls, field: str, value: Any) -> Items[Part]:
        """The check of an attribute that holds them."""
        return value if type(value) is cls else cls(checks.sequence(field, value, cls.words))

    def _all(self, items: Any, first: int) -> list[Part]:
        if isinstance(items, str) or not isinstance(items, Iterable):
            raise FieldError(self.field, f"must be a list of {self.words}", items)
        return [self._one(first + k, item) for k, item in enumerate(items)]

    def _one(self, number: int, item: Any) -> Part:
        if not isinstance(item, self.kinds):
            raise FieldError(f"{self.field}[{number}]", f"must be {self.words}", item)
        return item  # type: ignore[return-value]

    def append(self, item: Part) -> None:
        """Add one; raises FieldError for another kind."""
        super().append(self._one(len(self), item))

    def insert(self, place: SupportsIndex, item: Part) -> None:
        """Add one before a place; raises FieldError for another kind."""
        super().insert(place, self._one(int(place), item))

    def extend(self, items: Iterable[Part]) -> None:
        """Add some; raises FieldError for another kind."""
        super().extend(self._all(items, len(self)))

    def __iadd__(self, items: Iterable[Part]) -> Items[Part]:  # type: ignore[override, misc]
        self.extend(items)
        return self

    def __setitem__(self, place: Any, item: Any) -> None:
        if isinstance(place, slice):
            super().__setitem__(place, self._all(item, place.start or 0))
        else:
            super().__setitem__(place, self._one(int(place), item))


def a(kinds: type | tuple[type, ...], words: str) -> Check:
    """The check that a value is of a kind, as "a Camera"."""

    def check(field: str, value: Any) -> Any:
        if not isinstance(value, kinds):
            raise FieldError(field, f"must be {words}", value)
        return value

    return check


def either(word: str, check: Check) -> Check:
    """A check that lets a word pass."""

    def checked(field: str, value: Any) -> Any:
        return (
            checks.choice(field, value, (word,)) if isinstance(value, str) else check(field, value)
        )

    return checked


def perhaps(check: Check) -> Check:
    """A check that lets None pass."""
    return lambda field, value: None if value is None else check(field, value)


def number(**limits: Any) -> Check:
    """The check of a number, see `checks.number`."""
    return partial(checks.number, **limits)


def vector(**limits: Any) -> Check:
    """The check of three numbers, see `checks.vector`."""
    return partial(checks.vector, **limits)


def choice(*options: str) -> Check:
    """The check of a word."""
    return partial(checks.choice, options=options)


def frozen(cls: Kind) -> Kind:
    """A frozen dataclass that says in a sentence that it is not changed."""

    def refuse(self: Any, name: str, *value: Any) -> NoReturn:
        word = type(self).__name__
        article = "an" if word[0] in "AEIO" else "a"
        problem = (
            f"cannot be set: {article} {word} is never changed; make another (as of "
            "dataclasses.replace) and put it in its place"
        )
        raise FieldError(name, problem, *value)

    for name in ("__setattr__", "__delattr__"):
        setattr(cls, name, refuse)
    return cls
