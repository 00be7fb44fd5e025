"""Which lines of the changed modules each check executes on the reference, or each test."""

import math
import mmap
import socket
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from tests.zoo.machine.changes import Change
from tests.zoo.machine.modules import OWN, WIRE, source

Lines = frozenset[tuple[str, int]]
"""Each with its module."""
START, MEETING = "start", "meeting"
"""What is executed before the first connection, or while modules are read; and before any check."""
NOTHING: Lines = frozenset()
LONGEST_NAME = 128


@dataclass(frozen=True)
class Watched:
    """What was seen of the reference as it is."""

    lines: Mapping[str, Lines] = field(default_factory=dict)
    """Of each check or test, of START and of MEETING."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """Of each check or test."""

    def __or__(self, other: "Watched") -> "Watched":
        """Both; what they have of one name together."""
        both = {
            name: self.lines.get(name, NOTHING) | other.lines.get(name, NOTHING)
            for name in {**self.lines, **other.lines}
        }
        return Watched(both, {**self.seconds, **other.seconds})

    def telling(self, change: Change) -> list[str]:
        """The checks or tests that can tell it from the reference, the quickest first: those that
        execute it, or all where what it makes may last as long as the process does.
        """
        first, last = change.lines
        changed = {(change.module, number) for number in range(first, last + 1)}
        found = [name for name in self.seconds if changed & self.lines.get(name, NOTHING)]
        lasting = changed & self.lines.get(START, NOTHING)
        if lasting or (not found and changed & self.lines.get(MEETING, NOTHING)):
            found = list(self.seconds)
        return sorted(found, key=lambda name: self.seconds[name])

    def devotion(self, name: str, module: str) -> float:
        """How much of what a check executes of a module is executed by few others."""
        common = self._common
        return sum(1 / common[it] for it in self.lines.get(name, NOTHING) if it[0] == module)

    @cached_property
    def _common(self) -> Counter[tuple[str, int]]:
        return Counter(it for found in self.lines.values() for it in found)

    def as_json(self) -> dict[str, Any]:
        """For what is stored beside a result."""
        return {
            "seconds": self.seconds,
            "lines": {name: _folded(found) for name, found in self.lines.items()},
        }

    @classmethod
    def from_json(cls, members: dict[str, Any]) -> "Watched":
        """The reverse."""
        lines = {
            name: frozenset((module, it) for module, its in found.items() for it in its)
            for name, found in members["lines"].items()
        }
        return cls(lines, members["seconds"])


def _folded(found: Iterable[tuple[str, int]]) -> dict[str, list[int]]:
    folded: dict[str, list[int]] = {}
    for module, line in sorted(found):
        folded.setdefault(module, []).append(line)
    return folded


def trace(note: Callable[[str, int], bool], calls: float = math.inf) -> None:
    """Have each line of these modules that is executed from now on noted, in every thread.

    A function is looked at no more once nothing about it has been new for so many calls.
    """
    modules = {str(source(it)): it for it in (*WIRE, *OWN["client"], *OWN["server"])}
    nothing_new: Counter[CodeType] = Counter()

    def traced(frame: FrameType, event: str, _: Any) -> Any:
        code = frame.f_code
        module = modules.get(code.co_filename)
        if module is None:
            return None
        if note(module, frame.f_lineno):
            nothing_new[code] = 0
        elif event == "call":
            nothing_new[code] += 1
            if nothing_new[code] > calls:
                return None
        return traced

    threading.settrace(traced)
    sys.settrace(traced)


def watch(path: str) -> None:
    """Be a specimen that writes into a file each line that it executes, when it is for the first
    time since the harness has told of another check.
    """
    with now_of(path).open("rb") as file:
        now = mmap.mmap(file.fileno(), LONGEST_NAME, access=mmap.ACCESS_READ)
    met: list[object] = []
    for name in ("accept", "connect"):
        _note_calls(name, met)
    seen: set[tuple[bytes, str, int]] = set()

    def note(module: str, line: int) -> bool:
        label = now[:] if met else b""
        if (label, module, line) in seen:
            return False
        seen.add((label, module, line))
        check = label.rstrip(b"\0").decode() or (MEETING if met else START)
        with open(path, "a", encoding="ascii") as noted:  # noqa: PTH123 - quickest
            # An open one would be closed where a specimen is forked.
            noted.write(f"{check} {module} {line}\n")
        return True

    trace(note)


def _note_calls(name: str, calls: list[object]) -> None:
    original: Any = getattr(socket.socket, name)

    def called(*arguments: Any) -> Any:
        calls.append(name)
        return original(*arguments)

    setattr(socket.socket, name, called)


def now_of(path: str | Path) -> Path:
    """The file in which a harness tells which check it runs, beside one of lines."""
    return Path(f"{path}.now")


def nobody_yet(path: Path) -> None:
    """Make such a file, which tells of no check."""
    path.write_bytes(bytes(LONGEST_NAME))


def told(path: Path) -> str:
    """The check that such a file tells of."""
    return path.read_bytes().rstrip(b"\0").decode()


def tell(path: str) -> None:
    """Have the harness that runs in this process tell in a file which check it runs."""
    from splatbus_conformance.run.collector import Collector

    original = Collector.start

    def begins(self: Collector, name: str) -> None:
        with Path(path).open("r+b") as file:  # whoever reads it has it in memory
            file.write(name.encode().ljust(LONGEST_NAME, b"\0"))
        original(self, name)

    Collector.start = begins  # type: ignore[method-assign]


def noted(text: str) -> dict[str, Lines]:
    """What `watch` has written, by check."""
    found: dict[str, set[tuple[str, int]]] = {}
    for check, module, number in map(str.split, text.splitlines()):
        found.setdefault(check, set()).add((module, int(number)))
    return {check: frozenset(it) for check, it in found.items()}
