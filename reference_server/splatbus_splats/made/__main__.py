"""``python -m splatbus_splats.made``: writes the garden, and from where to look at it."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from splatbus_splats.files import ply
from splatbus_splats.made.garden import cameras, garden


def main(argv: list[str] | None = None) -> int:
    """Returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m splatbus_splats.made",
        description="Make a garden of Gaussians, the same one for the same seed.",
    )
    parser.add_argument("count", type=int, help="how many Gaussians")
    parser.add_argument("file", type=Path, help="to write: .ply")
    parser.add_argument("--degree", type=int, choices=range(4), default=3, help="of harmonics (3)")
    parser.add_argument("--seed", type=int, default=1, help="another one, another garden (1)")
    parser.add_argument(
        "--cameras", type=Path, metavar="JSON", help="to write too: from where to see it"
    )
    options = parser.parse_args(argv)
    if options.count < 1 or options.seed < 0:
        parser.error("a scene has 1 Gaussian or more, and a seed of 0 or more")
    if options.file.suffix.lower() != ".ply":
        parser.error(f"{options.file}: its name does not end in .ply")
    try:
        if options.cameras is not None:
            options.cameras.write_text(json.dumps(cameras(), indent=1) + "\n", "utf-8")
        ply.write(options.file, garden(options.count, options.degree, options.seed))
    except (OSError, MemoryError) as error:
        print(f"{parser.prog}: {error or 'memory is full'}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
