"""Which lines of the changed modules a run of the harness executes on the reference."""

import sys
import threading
from types import FrameType
from typing import Any

from splatbus_conformance.selftest.machine.changes import Change
from splatbus_conformance.selftest.machine.modules import OWN, WIRE, source

Lines = frozenset[tuple[str, int]]
"""Each with its module."""


def watch(path: str) -> None:
    """Note in a file, from now on, each line that is executed, when it is for the first time."""
    modules = {str(source(it)): it for it in (*WIRE, *OWN["client"], *OWN["server"])}
    seen: set[tuple[str, int]] = set()

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        module = modules.get(frame.f_code.co_filename)
        if module is None:
            return None
        where = module, frame.f_lineno
        if where not in seen:
            seen.add(where)
            with open(path, "a", encoding="ascii") as file:  # noqa: PTH123 - quickest
                # An open one would be closed where a specimen is forked.
                file.write(f"{module} {frame.f_lineno}\n")
        return trace

    threading.settrace(trace)
    sys.settrace(trace)


def noted(text: str) -> Lines:
    """What `watch` has written."""
    pairs = (line.split() for line in text.splitlines())
    return frozenset((module, int(number)) for module, number in pairs)


def executes(lines: Lines, change: Change) -> bool:
    """Whether what was changed is among what was executed."""
    first, last = change.lines
    return any((change.module, number) in lines for number in range(first, last + 1))
