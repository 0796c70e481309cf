"""What is remembered is what textwrap and inspect say."""

import inspect
import textwrap

from tisoft import reading_kernels


def test_lines_come_out_as_ever_and_are_the_callers_own():
    reading_kernels.keep_what_is_read()
    text = "a  line of several words, some of them long-winded, " * 4
    for width in (80, 30, 30):
        for wrapper in (
            textwrap.TextWrapper(width=width),
            textwrap.TextWrapper(width=width, drop_whitespace=False, initial_indent="> "),
        ):
            lines = wrapper.wrap(text)
            assert lines == reading_kernels._wrap(wrapper, text)
            lines.clear()
            assert wrapper.wrap(text)


def test_where_functions_stand_is_told_as_ever():
    reading_kernels.keep_what_is_read()
    for thing in (inspect.getsource, test_where_functions_stand_is_told_as_ever, textwrap):
        for _ in range(2):
            lines, first = inspect.getsourcelines(thing)
            assert (lines, first) == reading_kernels._source_lines(thing)
            assert inspect.getsourcefile(thing) == reading_kernels._source_file(thing)
            if thing is not textwrap:  # whose lines inspect itself shares with all who ask
                lines.clear()


def test_two_functions_of_one_name_are_two():
    reading_kernels.keep_what_is_read()

    def made(k):
        if k:
            return lambda: "first"
        return lambda: "second"

    first, second = (inspect.getsourcelines(made(k))[0] for k in (True, False))
    assert "first" in first[0] and "second" in second[0]


def test_no_more_lines_are_kept_than_there_is_room_for(monkeypatch):
    reading_kernels.keep_what_is_read()
    monkeypatch.setattr(reading_kernels, "MOST", 10)
    for n in range(50):
        assert textwrap.wrap(f"line {n}") == [f"line {n}"]
        assert len(reading_kernels._kept) <= 10
