"""The command ``python -m splatbus_splats``: a file of Gaussians, served over both channels."""

from __future__ import annotations

import argparse
import logging
import os
import re
import signal
import sys
import threading
from pathlib import Path

from splatbus_schemas.version import ShowVersion
from splatbus_server.api import serve
from splatbus_server.view import Intrinsics
from splatbus_wire.lens import as_high
from splatbus_wire.messages import DEFAULT_OBJECT
from splatbus_wire.settings import read_token

from splatbus_splats.files.cameras import Camera, read_cameras
from splatbus_splats.files.read import Found, read

NAME = "splatbus_splats"
EPILOG = """\
examples:
  python -m splatbus_splats.made 100000 scene.ply   make a scene, if you have none
  python -m splatbus_splats scene.ply               serve it on 127.0.0.1, ports 6001 and 6000
  python -m splatbus_splats point_cloud.ply --cameras cameras.json --size 1280x720

what next:
  Wait for the line with "ready", then look, in another terminal:
      splatbus-client snapshot out.png
  Stop with Ctrl-C.

exit codes: 0 stopped by SIGINT or SIGTERM, 1 a file cannot be read, an address is taken or memory
is full, 2 wrong usage
"""


def main(argv: list[str] | None = None) -> int:
    """Serves until SIGINT or SIGTERM; returns the exit code."""
    options = _parser().parse_args(argv)
    logging.basicConfig(
        format="%(asctime)s %(levelname)-7s %(message)s",
        level=logging.WARNING if options.quiet else logging.INFO,
    )
    try:
        found = read(options.file, None if options.quiet else _Progress(options.file.name))
        cameras = read_cameras(options.cameras) if options.cameras else []
        from splatbus_splats import serving  # needs the extra, and compiles
    except ImportError as error:
        print(f"{NAME}: {error}: pip install 'splatbus-protocol[splats]'", file=sys.stderr)
        return 1
    except (OSError, ValueError) as error:
        print(f"{NAME}: {error}", file=sys.stderr)
        return 1
    if not options.quiet:
        print(_summary(options.file.name, found), file=sys.stderr, flush=True)
    width, height = options.size
    lens = serving.lens_for(width, height, [found.gaussians])
    if cameras:
        lens = _lens_of(cameras[0], options.size, lens.far)

    stop = threading.Event()
    for name in ("SIGINT", "SIGTERM"):
        signal.signal(getattr(signal, name), lambda *_: stop.set())
    try:
        token = None if options.token_file is None else read_token(options.token_file)
        bus = serve(
            *options.size,
            intrinsics=lens,
            cameras=[each.pose for each in cameras],
            semantics=serving.SEMANTICS,
            objects=[serving.described(DEFAULT_OBJECT, options.file.name, found.gaussians)],
            host=options.host,
            ipc_port=options.ipc_port,
            message_port=options.msg_port,
            token=token,
        )
    except ValueError as error:
        print(f"{NAME}: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"{NAME}: {error.strerror or error}", file=sys.stderr)
        return 1
    with bus:
        address = bus.address
        print(
            f"{NAME} ready on {address.host}: IPC port {address.ipc_port},"
            f" message port {address.message_port}, {width}x{height}",
            flush=True,
        )
        serving.render_until(stop, bus, {DEFAULT_OBJECT: found.gaussians}, os.cpu_count() or 1)
    return 0


class _Progress:
    """Says on standard error, at every tenth, how much of a file was read."""

    def __init__(self, name: str) -> None:
        self._name, self._tenths = name, 0

    def __call__(self, done: int, whole: int) -> None:
        tenths = 10 * done // whole
        if tenths > self._tenths:
            self._tenths = tenths
            print(f"{self._name}: {tenths}0% read", file=sys.stderr, flush=True)


def _summary(name: str, found: Found) -> str:
    gaussians, left_out = found
    box = gaussians.bounds
    where = f", from {_point(box.min)} to {_point(box.max)}" if box else ""
    without = "".join(f"; {count:,} left out: {why}" for why, count in left_out.items())
    return f"{name}: {len(gaussians):,} Gaussians of degree {gaussians.degree}{where}{without}"


def _point(point: tuple[float, float, float]) -> str:
    return f"({', '.join(f'{each:.4g}' for each in point)})"


def _lens_of(camera: Camera, size: tuple[int, int], far: float) -> Intrinsics:
    """What the camera saw, from its upper to its lower edge, for images of this size."""
    fx, fy, cx, cy, *_ = as_high(camera.lens, *size)
    return Intrinsics(fx, fy, cx, cy, camera.lens.near, far)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m splatbus_splats",
        description="Serve a file of Gaussians over SplatBus 1.0 and 1.1, drawn on the processor.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=ShowVersion)
    parser.add_argument("file", type=Path, help=".ply as 3DGS writes it, or .splat")
    parser.add_argument(
        "--cameras", type=Path, metavar="FILE", help="cameras.json of 3DGS; the view begins there"
    )
    parser.add_argument(
        "--size", type=_size, default=(640, 480), metavar="WxH", help="of the image (640x480)"
    )
    parser.add_argument("--host", help="to listen on (127.0.0.1); another one needs a token")
    parser.add_argument("--ipc-port", type=int, metavar="PORT", help="6001; 0: any that is free")
    parser.add_argument("--msg-port", type=int, metavar="PORT", help="6000; 0: any that is free")
    parser.add_argument(
        "--token-file", type=Path, metavar="FILE", help="holds the token; only you can read it"
    )
    parser.add_argument("--quiet", action="store_true", help="log refusals and errors only")
    return parser


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)[x×](\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 640x480")
    return int(match[1]), int(match[2])
