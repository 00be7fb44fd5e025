"""The version of this project as it is installed, for the commands that say it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn

DISTRIBUTION = "splatbus-protocol"


def installed_version() -> str:
    """As it was installed; `unknown` where it runs from a folder without that."""
    from importlib import metadata  # takes as long to import as all else that a command needs

    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "unknown"


class ShowVersion(argparse.Action):
    """An option that prints the name of the command and the version, and ends it."""

    def __init__(self, option_strings: Sequence[str], dest: str, **more: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, help="show the version and exit", **more)

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> NoReturn:
        """Print it."""
        print(parser.prog, installed_version())
        parser.exit()
