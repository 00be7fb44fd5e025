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
  Drag to turn, use the wheel to go nearer, W A S D E Q to go. 1 to 4 change what is shown, Tab
  hides the panels, P takes a picture. The camera is the server's until you move it.

examples:
  splatbus-server                             start a server, in another terminal
  splatbus-client window                      look at it
  splatbus-client window --mode depth --size 1920x1080
  splatbus-client window --bare --screenshot out.png
                                              write one picture of the window, and end

It needs a display, and the extra: pip install 'splatbus-protocol[window]'
"""


def add(commands: Any, where: argparse.ArgumentParser) -> None:
    """Add the command to those of `splatbus-client`."""
    parser = commands.add_parser(
        "window",
        parents=[where],
        help="look through a window, and steer by hand",
        description="Shows a server's images in a window: colour, depth, normals, or a grid and a\n"
        "ring among the splats. You steer the camera by hand, objects by handles, and time\n"
        "by a slider. Panels plot the server's figures and what comes, and log all packets.\n"
        "Connects again whenever the server goes and comes back.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--size",
        type=SIZE,
        default=(1280, 800),
        metavar="WxH",
        help="size of the window (default: 1280x800); the images follow it",
    )
    parser.add_argument(
        "--mode",
        choices=MODES,
        default="composite",
        help="what to show first (default: %(default)s)",
    )
    parser.add_argument(
        "--camera",
        choices=KINDS,
        default="orbit",
        help="how the camera moves first (default: %(default)s)",
    )
    parser.add_argument("--bare", action="store_true", help="start without panels; Tab shows them")
    parser.add_argument(
        "--screenshot",
        type=Path,
        metavar="FILE.png",
        help="write a picture of the window once images of its size come, and end",
    )
    parser.add_argument(
        "--timeout",
        type=POSITIVE,
        default=10.0,
        metavar="SECONDS",
        help="with --screenshot: give up after this time (default: %(default)g)",
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
