"""The words of `splatbus-client window`; what it needs is loaded once it is asked for."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from splatbus_schemas.options import POSITIVE, SIZE
from splatbus_wire.settings import Settings

from splatbus_viewer.window import MODES
from splatbus_viewer.window.cameras import KINDS

_EPILOG = """\
in the window:
  drag turns, the wheel goes nearer, W A S D E Q go; 1 to 4 change what is shown; Tab hides the
  panels, P takes a picture. The camera is the server's until you move it.

examples:
  splatbus-server                             start a server, in another terminal
  splatbus-client window                      look at it
  splatbus-client window --mode depth --size 1920x1080
  splatbus-client window --bare --screenshot out.png
                                              one picture of the window, and no more

It needs a display, and the extra: pip install 'splatbus-protocol[window]'
"""


def add(commands: Any, where: argparse.ArgumentParser) -> None:
    """Add the command to those of `splatbus-client`."""
    parser = commands.add_parser(
        "window",
        parents=[where],
        help="look through a window, and steer by hand",
        description="Shows a server's images in a window, and steers by hand: colour, depth,\n"
        "normals, or a grid and a ring among the splats; objects by handles, time by a\n"
        "slider; with plots of the server's figures and of what comes, and a log of all\n"
        "packets. Connects again whenever the server goes and comes back.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--size",
        type=SIZE,
        default=(1280, 800),
        metavar="WxH",
        help="of the window (1280x800); images follow it",
    )
    parser.add_argument(
        "--mode", choices=MODES, default="composite", help="what is shown first (%(default)s)"
    )
    parser.add_argument(
        "--camera", choices=KINDS, default="orbit", help="how it moves first (%(default)s)"
    )
    parser.add_argument("--bare", action="store_true", help="without panels; Tab brings them")
    parser.add_argument(
        "--screenshot",
        type=Path,
        metavar="FILE.png",
        help="write a picture of the window once images come in its size, and end",
    )
    parser.add_argument(
        "--timeout",
        type=POSITIVE,
        default=10.0,
        metavar="SECONDS",
        help="with --screenshot: give up after so long (%(default)g)",
    )
    parser.set_defaults(run=_window)


def _window(where: Settings, options: argparse.Namespace) -> int:
    try:
        from splatbus_viewer.window.app import show
    except ImportError as problem:
        extra = "install it with: pip install 'splatbus-protocol[window]'"
        print(f"a window needs {problem.name or problem}; {extra}", file=sys.stderr)
        return 1
    return show(where, options)
