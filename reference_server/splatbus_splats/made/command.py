"""The command that writes a scene, and from where to look at it."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from splatbus_splats.files import ply, splat
from splatbus_splats.made.balls import made
from splatbus_splats.made.garden import VIEWS, garden
from splatbus_splats.made.views import cameras

SCENES = {"balls": made, "garden": garden}
FORMATS = {".ply": ply.write, ".splat": splat.write}


def main(argv: list[str] | None = None) -> int:
    """Writes a scene; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m splatbus_splats.made",
        description="Make a scene of Gaussians, the same one for the same seed.",
    )
    parser.add_argument("count", type=int, help="how many Gaussians")
    parser.add_argument("file", type=Path, help="to write: .ply, or .splat (degree 0, 8 bits)")
    parser.add_argument("--degree", type=int, choices=range(4), default=3, help="of harmonics (3)")
    parser.add_argument("--seed", type=int, default=1, help="another one, another scene (1)")
    parser.add_argument(
        "--scene",
        choices=SCENES,
        default="balls",
        help="balls, to measure with, or a garden, to look at (balls)",
    )
    parser.add_argument(
        "--cameras", type=Path, metavar="JSON", help="to write too: from where to see the garden"
    )
    options = parser.parse_args(argv)
    if options.count < 1 or options.seed < 0:
        parser.error("a scene has 1 Gaussian or more, and a seed of 0 or more")
    if options.cameras is not None and options.scene != "garden":
        parser.error("--cameras is for the garden")
    if options.file.suffix.lower() not in FORMATS:
        parser.error(f"{options.file}: its name ends in neither {' nor '.join(FORMATS)}")
    try:
        if options.cameras is not None:
            options.cameras.write_text(json.dumps(cameras(VIEWS), indent=1) + "\n", "utf-8")
        scene = SCENES[options.scene](options.count, options.degree, options.seed)
        FORMATS[options.file.suffix.lower()](options.file, scene)
    except KeyboardInterrupt:
        return 130
    except OSError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return 1
    except MemoryError as error:
        print(f"{parser.prog}: memory is full: {error}", file=sys.stderr)
        return 1
    return 0
