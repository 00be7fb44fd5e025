"""The words of `splatbus-client window`; what it needs is loaded once it is asked for."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from splatbus_wire.settings import Settings


def add(commands: Any, where: argparse.ArgumentParser) -> None:
    """Add the command to those of `splatbus-client`."""
    parser = commands.add_parser(
        "window", parents=[where], help="look through a window, and steer by hand"
    )
    parser.set_defaults(run=_window)


def _window(where: Settings, options: argparse.Namespace) -> int:
    try:
        from splatbus_viewer.window.app import show  # type: ignore[import-not-found]
    except ImportError as problem:
        print(problem, file=sys.stderr)
        return 1
    return int(show(where, options))
