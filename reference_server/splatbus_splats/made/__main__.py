"""``python -m splatbus_splats.made``: writes the garden, and from where to look at it."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from splatbus_schemas.options import COUNT
from splatbus_schemas.visible import worded

from splatbus_splats.files import ply
from splatbus_splats.made.garden import cameras, garden


def main(argv: list[str] | None = None) -> int:
    """Returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m splatbus_splats.made",
        description="Make a garden of Gaussians, each time the same one.",
    )
    parser.add_argument("count", type=COUNT, help="how many Gaussians")
    parser.add_argument("file", type=Path, help="to write: .ply")
    parser.add_argument(
        "--cameras", type=Path, metavar="JSON", help="to write too: from where to see it"
    )
    options = parser.parse_args(argv)
    if options.file.suffix.lower() != ".ply":
        parser.error(f"{options.file}: its name does not end in .ply")
    try:
        if options.cameras is not None:
            options.cameras.write_text(json.dumps(cameras(), indent=1) + "\n", "utf-8")
        ply.write(options.file, garden(options.count))
    except (OSError, MemoryError) as error:
        print(f"{parser.prog}: {worded(error) or 'memory is full'}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
