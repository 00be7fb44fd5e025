"""Data files of this package, and where what it makes for later is kept."""

import json
import os
import tempfile
from importlib.resources import files
from pathlib import Path
from typing import Any


def read_json(name: str) -> Any:
    """The JSON file of this name, parsed."""
    return json.loads(read_text(name))


def read_text(name: str) -> str:
    """The data file of this name."""
    return files(__package__).joinpath(name).read_text("utf-8")


def cache_folder() -> Path:
    """In the user's cache, or among temporary files for a user who has no home."""
    try:
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        cache = Path(tempfile.gettempdir())
    return cache / "splatbus-conformance"
