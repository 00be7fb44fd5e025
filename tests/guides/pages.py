"""The code blocks of the pages that people read, and the commands in them."""

import re
import shlex
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    {
        ROOT / "README.md",
        ROOT / "spec" / "vectors" / "README.md",
        *(ROOT / "conformance").glob("*.md"),
        *(ROOT / "conformance" / "guides").glob("*.md"),
        *(ROOT / "reference_server").rglob("*.md"),
        *(ROOT / "reference_client").rglob("*.md"),
    }
)
SHELLS = ("sh", "bat")
OURS = ("splatbus-conformance", "splatbus-server", "splatbus-client")
BLOCK = re.compile(
    r"^(?:<!-- not run: (?P<why>.+?) -->\n)?```(?P<language>\w*)[^\n]*\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


class Block(NamedTuple):
    """A code block of a page."""

    page: str
    line: int
    language: str
    text: str
    why_not_run: str
    """In words, from the comment above it; nothing if there is none."""

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def blocks(page: Path) -> list[Block]:
    text = page.read_text("utf-8")
    return [
        Block(
            page.relative_to(ROOT).as_posix(),
            text.count("\n", 0, found.start()) + 1,
            found["language"],
            found["text"],
            found["why"] or "",
        )
        for found in BLOCK.finditer(text)
    ]


ALL = [block for page in PAGES for block in blocks(page)]


def our_commands(block: Block) -> list[list[str]]:
    """The commands of this project in a block, as words: also where others stand before them.

    A block that belongs to no shell shows what a program prints, or lists commands, with an
    explanation behind each, two spaces or a # away.
    """
    found = []
    for line in block.text.splitlines():
        if block.language not in SHELLS:
            line = "" if ": " in line else re.split(r" {2,}|#", line, maxsplit=1)[0]
        for part in line.split(" && "):
            name = re.split(r"[/\\]", part.split(" ")[0])[-1]
            if name in OURS:
                found.append([name, *shlex.split(part)[1:]])
    return found
