"""Which steps from line to line an input makes, in some packages only."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from tests.fuzz.targets import Target

Step = tuple[CodeType, int, int]


class Reach:
    """Traces runs of a target."""

    def __init__(self, target: Target) -> None:
        self._run = target.run
        self._folders = tuple(str(_folder(name)) for name in target.packages)
        self._is_wanted: dict[CodeType, bool] = {}
        self.known: set[Step] = set()

    def run(self, data: bytes) -> int:
        """Runs the target with this; how many steps it made that none before it made."""
        steps: set[Step] = set()
        add = steps.add

        def enter(frame: FrameType, event: str, _: Any) -> Any:
            code = frame.f_code
            wanted = self._is_wanted.get(code)
            if wanted is None:
                wanted = code.co_filename.startswith(self._folders)
                self._is_wanted[code] = wanted
            if not wanted:
                return None
            last = 0

            def line(frame: FrameType, event: str, _: Any) -> Any:
                nonlocal last
                if event == "line":
                    add((code, last, frame.f_lineno))
                    last = frame.f_lineno
                return line

            return line

        former = sys.gettrace()
        sys.settrace(enter)
        try:
            self._run(data)
        finally:
            sys.settrace(former)
        new = steps - self.known
        self.known |= new
        return len(new)


def _folder(package: str) -> Path:
    found = importlib.util.find_spec(package)
    assert found is not None
    assert found.origin is not None
    return Path(found.origin).parent
