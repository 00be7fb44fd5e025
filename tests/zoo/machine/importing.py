"""Changes a module while it is imported; nothing is written anywhere."""

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

from tests.zoo.machine.changes import changed


class _Changed(SourceFileLoader):
    """Compiles another tree than the one that is written."""

    change = ""

    def get_code(self, fullname: str) -> CodeType:
        """Of the changed tree; what was compiled before is not looked at."""
        tree = changed(Path(self.path).read_text("utf-8"), self.change)
        return compile(tree, self.path, "exec")


class _Finder:
    """Finds one module, and has it changed."""

    def __init__(self, change: str) -> None:
        self._change = change

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """As Python's own finder has it, with another loader."""
        if name != self._change.partition(":")[0]:
            return None
        spec = PathFinder.find_spec(name, path, target)
        assert spec is not None, f"there is no module {name}"
        assert spec.origin is not None, f"{name} has no source"
        spec.loader = _Changed(name, spec.origin)
        spec.loader.change = self._change
        return spec


def change_on_import(change: str) -> None:
    """Have a change made in this process, whose module was not imported yet."""
    module = change.partition(":")[0]
    assert module not in sys.modules, f"{module} was imported before it could be changed"
    sys.meta_path.insert(0, _Finder(change))
