"""Each page of docs/tasks works from its first block to its last, in one folder, as a reader would.

```toml names its file in the first line, ```sh has commands, ```python goes on where it stopped.
"""

import re
import shlex
from pathlib import Path

import pytest

from tisoft.cli import main
from tisoft.commands.demo import shipped

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs" / "tasks").glob("*.md"))
BLOCK = re.compile(r"^```(.*?)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
LONGEST = 60
"""Lines of a page."""
SHORTER = {"render": ["--set", "duration=0.1", "--size", "64x48", "--set", "render.samples=1"]}
"""Options that make a command end soon."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_works(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "assets").symlink_to(shipped("assets"))
    text = page.read_text(encoding="utf-8")
    assert text.count("\n") <= LONGEST
    blocks = BLOCK.findall(text)
    assert blocks and text.count("```") == 2 * len(blocks)
    names: dict[str, object] = {}
    for kind, block in blocks:
        if kind == "toml":
            name = re.match(r"# (\S+\.toml)\n", block)[1]
            Path(name).write_text(block, encoding="utf-8")
        elif kind == "python":
            exec(compile(block, page.name, "exec"), names)
        else:
            assert kind == "sh"
            for line in block.splitlines():
                program, command, *words = shlex.split(line, comments=True)
                assert program == "tisoft"
                assert main([command, *words, *SHORTER.get(command, [])]) == 0, line


def test_the_gallery_leads_to_every_task():
    gallery = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert {f"tasks/{page.name}" for page in PAGES} <= set(re.findall(r"\]\((.+?)\)", gallery))
