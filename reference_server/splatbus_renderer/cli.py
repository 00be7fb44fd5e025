"""The command ``splatbus-server``: a scene to look at, served over both channels."""

from __future__ import annotations

import argparse
import logging
import signal
import sys
import threading
from pathlib import Path

from splatbus_schemas.options import PORT, POSITIVE, SIZE, option, within
from splatbus_schemas.version import ShowVersion
from splatbus_schemas.visible import worded
from splatbus_server.api import serve
from splatbus_wire.settings import read_token

from splatbus_renderer.demo import BOBBING_TIME, FPS, OBJECTS, render_until, turning_time

EPILOG = """\
examples:
  splatbus-server                             serve on 127.0.0.1, ports 6001 and 6000
  splatbus-server --ipc-port 0 --msg-port 0   let the system choose; the ready line says which
  splatbus-server --size 1920x1080 --turntable 20
  splatbus-server --host 0.0.0.0 --token-file ~/.splatbus-token

environment (an option wins over it):
  SPLATBUS_HOST, SPLATBUS_IPC_PORT, SPLATBUS_MSG_PORT   where to listen
  SPLATBUS_TOKEN                                        the token that clients have to send

what next:
  Wait for the line that begins with "splatbus-server ready", then look, in another terminal:
      splatbus-client --help
  Stop with Ctrl-C. To serve your own renderer, see reference_server/README.md.

exit codes: 0 stopped by SIGINT or SIGTERM, 1 an address is taken or memory is full, 2 wrong usage
"""


def main(argv: list[str] | None = None) -> int:
    """Serves until SIGINT or SIGTERM; returns the exit code."""
    options = parser().parse_args(argv)
    logging.basicConfig(
        format="%(asctime)s %(levelname)-7s %(message)s",
        level=logging.WARNING if options.quiet else logging.INFO,
    )
    # A renderer in plain Python holds the interpreter's lock for 5 ms at a time, and a reply waits
    # for it. This is for the program to decide, never for a library.
    sys.setswitchinterval(0.0005)
    stop = threading.Event()
    for name in ("SIGINT", "SIGTERM"):
        signal.signal(getattr(signal, name), lambda *_: stop.set())
    try:
        token = None if options.token_file is None else read_token(options.token_file)
        bus = serve(
            *options.size,
            objects=OBJECTS,
            time_range=turning_time(options.turntable) or BOBBING_TIME,
            host=options.host,
            ipc_port=options.ipc_port,
            message_port=options.msg_port,
            token=token,
        )
    except ValueError as error:
        print(f"splatbus-server: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"splatbus-server: {worded(error)}", file=sys.stderr)
        return 1
    with bus:
        address, (width, height) = bus.address, options.size
        print(
            f"splatbus-server ready on {address.host}: IPC port {address.ipc_port},"
            f" message port {address.message_port}, {width}x{height}",
            flush=True,
        )
        render_until(stop, bus, options.fps, options.turntable)
    logging.getLogger("splatbus_server").info("stopped: %s", bus.statistics)
    return 0


def parser() -> argparse.ArgumentParser:
    """Its options."""
    parser = argparse.ArgumentParser(
        prog="splatbus-server",
        description="Serve a small scene over SplatBus 1.0 and 1.1, to try viewers with.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=ShowVersion)
    parser.add_argument(
        "--size",
        type=SIZE,
        default=(320, 240),
        metavar="WxH",
        help="size of the images in pixels (default: 320x240 for spheres, 640x480 for files)",
    )
    parser.add_argument(
        "--fps", type=POSITIVE, default=FPS, help=f"most images a second (default: {FPS:g})"
    )
    parser.add_argument(
        "--turntable",
        type=option(within(float, -1e6, 1e6), "number from -1000000 to 1000000, such as 20"),
        default=0.0,
        metavar="DEGREES",
        help="turn the spheres by this angle each second",
    )
    parser.add_argument(
        "--host", help="address to listen on (default: 127.0.0.1); others need a token"
    )
    for name, kind, usual in (("ipc", "IPC", 6001), ("msg", "message", 6000)):
        parser.add_argument(
            f"--{name}-port",
            type=PORT,
            metavar="PORT",
            help=f"port of the {kind} channel (default: {usual}); 0 takes any free port",
        )
    parser.add_argument(
        "--token-file",
        type=Path,
        metavar="FILE",
        help="file that holds the token; nobody but you may be able to read it (chmod 600)",
    )
    parser.add_argument("--quiet", action="store_true", help="log only refusals and errors")
    return parser


if __name__ == "__main__":
    sys.exit(main())
