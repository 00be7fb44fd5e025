"""Data files of this package."""

import json
from importlib.resources import files
from typing import Any


def read_json(name: str) -> Any:
    """The JSON file of this name, parsed."""
    return json.loads(read_text(name))


def read_text(name: str) -> str:
    """The data file of this name."""
    return files(__package__).joinpath(name).read_text("utf-8")
