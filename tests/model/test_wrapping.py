"""Remembered lines are the lines that textwrap makes."""

import textwrap

from tisoft import wrapping


def test_lines_come_out_as_ever_and_are_the_callers_own():
    wrapping.keep_wrapped_lines()
    text = "a  line of several words, some of them long-winded, " * 4
    for width in (80, 30, 30):
        for wrapper in (
            textwrap.TextWrapper(width=width),
            textwrap.TextWrapper(width=width, drop_whitespace=False, initial_indent="> "),
        ):
            lines = wrapper.wrap(text)
            assert lines == wrapping._wrap(wrapper, text)
            lines.clear()
            assert wrapper.wrap(text)


def test_no_more_lines_are_kept_than_there_is_room_for(monkeypatch):
    wrapping.keep_wrapped_lines()
    monkeypatch.setattr(wrapping, "MOST", 10)
    for n in range(50):
        assert textwrap.wrap(f"line {n}") == [f"line {n}"]
        assert len(wrapping._kept) <= 10
