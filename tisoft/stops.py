"""Signals that ask a command to end: Ctrl-C, SIGTERM (batch systems, `timeout`), SIGHUP, SIGXCPU.

The first of them raises `Stopped`, so that `with` blocks finish their files, or is noted where
that would do harm:

| where                        | what a signal does                                               |
| ---------------------------- | ---------------------------------------------------------------- |
| reading, computing           | raises                                                           |
| `held()`: a file is finished | is noted, raises at the end of the block                         |
| `between_frames()`: stepping | is noted, for the end of the frame; raises after PATIENCE        |
| `settled()` was called       | nothing: the result is written, the command ends as it would     |

What is noted stays noted, and is raised again after a while: a library that swallows the exception
does not swallow the end.  A signal that the parent of this process ignores (`nohup`, a shell's
background job) stays ignored.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, NoReturn

SIGNALS = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGXCPU")
    if hasattr(signal, name)
)
GRACE = 1.0
"""Seconds after a signal in which more of them are the same wish, and the end has time to come."""
PATIENCE = 3.0
"""Seconds that a frame may take to end by itself; who asked sends SIGKILL after ten or so."""


class Stopped(KeyboardInterrupt):
    """A signal asked the command to end; `number` is the signal's."""

    def __init__(self, number: int) -> None:
        self.number = number
        name = signal.Signals(number).name
        super().__init__("interrupted" if name == "SIGINT" else f"ended by {name}")

    @property
    def exit_code(self) -> int:
        """128 + the signal's number: 130 after Ctrl-C."""
        return 128 + self.number


class _Wish:
    """What was asked for, and what may be done about it now."""

    def __init__(self) -> None:
        self.number: int | None = None
        self.when = 0.0
        self.held = 0
        self.between_frames = 0
        self.settled = False

    def note(self, number: int, frame: FrameType | None) -> None:
        """The handler of a signal."""
        now = time.monotonic()
        first, again = self.number is None, now - self.when >= GRACE
        if self.settled:
            return
        if first:
            self.number = number
        if first or again:
            self.when = now
        if self.held:
            return
        if first and self.between_frames:
            _alarm(PATIENCE)
        elif first or again:
            self._raise()

    def remind(self, number: int, frame: FrameType | None) -> None:
        """The handler of the alarm: a frame is long, or somebody has swallowed the exception."""
        if self.number is None or self.settled:
            return
        if self.held:
            _alarm(0.1)
        else:
            self._raise()

    def call_back(self, lost: Any) -> bool:
        """Whether this is an end that came where nothing can be raised; it comes again at once."""
        mine = isinstance(lost.exc_value, Stopped)
        if mine:
            _alarm(0.001)
        return mine

    def _raise(self) -> NoReturn:
        assert self.number is not None
        _alarm(GRACE)
        raise Stopped(self.number)


_wish = _Wish()


def heeding(work: Callable[[], int], tell: Callable[[str, int], int], *, last: bool = False) -> int:
    """Run `work` with signals heeded; returns its exit code, or tell(sentence, code) when stopped.

    Args:
        work: may raise `Stopped` at any moment.
        tell: says why it ended, and returns the exit code.
        last: the process ends afterwards, so signals are ignored then, instead of handled as
            before.
    """
    global _wish
    if threading.current_thread() is not threading.main_thread():
        return work()  # only the main thread is told of signals
    outer, _wish = _wish, _Wish()
    _wish.held = 1
    before, hook = _handle(_wish), sys.unraisablehook
    sys.unraisablehook = lambda lost: _wish.call_back(lost) or hook(lost)
    try:
        try:
            _wish.held = 0
            raise_if_asked()
            code = work()
            settled()
            return code
        except KeyboardInterrupt as stop:
            settled()
            return tell(str(stop) or "interrupted", getattr(stop, "exit_code", 130))
    finally:
        _alarm(0.0)
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if last else handler)
        sys.unraisablehook = hook
        _wish = outer


def _handle(wish: _Wish) -> dict[int, Any]:
    """Let `wish` handle the signals that the parent does not ignore; returns who did before."""
    before: dict[int, Any] = {}
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            before[number] = signal.signal(number, wish.note)
    if hasattr(signal, "SIGALRM"):
        before[signal.SIGALRM] = signal.signal(signal.SIGALRM, wish.remind)
    return before


@contextmanager
def held() -> Iterator[None]:
    """Let a file be finished: a signal inside raises `Stopped` when the block ends."""
    wish = _wish
    was = wish.number
    wish.held += 1
    try:
        yield
    finally:
        wish.held -= 1
    if was is None and not wish.held and not wish.between_frames:
        raise_if_asked()


@contextmanager
def between_frames() -> Iterator[None]:
    """Let a frame be finished: who steps inside calls `raise_if_asked` when one is."""
    wish = _wish
    wish.between_frames += 1
    try:
        yield
    finally:
        wish.between_frames -= 1
        _alarm(0.0)


@contextmanager
def kept_back() -> Iterator[None]:
    """Keep signals back: a process that is started inside never gets them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def settled() -> None:
    """From here on the command ends as it would, whoever asks."""
    _wish.settled = True


def asked() -> Stopped | None:
    """The end that was asked for and has not come yet."""
    return None if _wish.number is None or _wish.settled else Stopped(_wish.number)


def last_asked() -> float:
    """When a signal asked last, on the monotonic clock [s]; 0 where none did."""
    return _wish.when


def raise_if_asked() -> None:
    """End here if that was asked for; raises Stopped."""
    if (stop := asked()) is not None:
        raise stop


def ended_by(kind: type[BaseException] | None) -> bool:
    """Whether an exception of this kind is the end that was asked for, whatever a library that it
    passed through made of it.
    """
    return kind is not None and (issubclass(kind, KeyboardInterrupt) or asked() is not None)


@contextmanager
def as_stops() -> Iterator[None]:
    """Raise `Stopped` for what fails inside once an end was asked for: it failed because of it."""
    try:
        yield
    except KeyboardInterrupt:
        raise
    except BaseException:
        raise_if_asked()
        raise


def _alarm(seconds: float) -> None:
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)
