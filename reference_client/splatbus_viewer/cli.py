"""`splatbus-client`: what a person types."""

from __future__ import annotations

import argparse
import io
import logging
import math
import os
import re
import signal
import sys
import threading
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from splatbus_client.message_protocol import NotOfferedError
from splatbus_client.session import Session
from splatbus_client.steering import ServerRefusedError
from splatbus_schemas import FRAMING
from splatbus_schemas.options import PORT, POSITIVE, SIZE, WHOLE, joined, option
from splatbus_schemas.version import ShowVersion
from splatbus_schemas.visible import worded
from splatbus_wire.poses import Pose
from splatbus_wire.settings import Settings, read_token, settings

from splatbus_viewer import telemetry
from splatbus_viewer.info import describe
from splatbus_viewer.poses import parse_look_at, parse_pose
from splatbus_viewer.view import view
from splatbus_viewer.window import command as window

_CHANNELS = FRAMING["channels"]

_EPILOG = """\
environment:
  SPLATBUS_HOST       host of the server (default: 127.0.0.1)
  SPLATBUS_IPC_PORT   port of its IPC channel (default: 6001)
  SPLATBUS_MSG_PORT   port of its message channel (default: 6000)
  SPLATBUS_TOKEN      token, if the server requires one. There is no option for it, because other
                      users of the machine can read the options of every process

examples:
  splatbus-server                                   start a server, in another terminal
  splatbus-client view                              watch it until Ctrl-C
  splatbus-client view --rate 60 --seconds 10       send 60 camera poses a second, for 10 seconds
  splatbus-client window                            look through a window, and steer by hand
  splatbus-client snapshot out.png                  write one picture of what it shows now
  splatbus-client snapshot out.png --camera-index 2 write one from the scene's third camera
  splatbus-client snapshot out.png --look-at "0,-1,-2, 0,0,4"
  splatbus-client info                              tell what the server can do, and its scene
  splatbus-client telemetry render_ms               print one of its figures, live

exit status: 0 done, 1 failed (standard error says why), 2 wrong usage
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    options, unknown = _parser().parse_known_args(
        joined(sys.argv[1:] if arguments is None else arguments, "--pose", "--look-at")
    )
    if unknown:
        names = re.findall("--[a-z-]+", options.command.format_usage())
        near = get_close_matches(unknown[0].partition("=")[0], names, 1)
        hint = f": did you mean {near[0]}?" if near else ""
        options.command.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # not every terminal has every bar and name
    logging.basicConfig(
        level=logging.INFO if options.verbose else logging.WARNING,
        format="\r\x1b[K%(message)s" if sys.stderr.isatty() else "%(message)s",
        stream=sys.stderr,
    )
    try:
        token = read_token(options.token_file) if options.token_file else None
        where = settings(options.host, options.ipc_port, options.msg_port, token)
    except (ValueError, OSError) as error:
        print(f"splatbus-client: {worded(error)}", file=sys.stderr)
        return 2
    try:
        run: int = options.run(where, options)
        return run
    except BrokenPipeError:  # whoever read our output has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (ValueError, OSError, ServerRefusedError, NotOfferedError) as error:
        print(f"splatbus-client: {worded(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def _view(where: Settings, options: argparse.Namespace) -> int:
    stopped = _stopped_by_signals()
    with Session(where) as session:
        view(
            session,
            rate=options.rate,
            seconds=options.seconds,
            stopped=stopped,
            out=sys.stdout,
            size=options.size,
        )
    return 0


def _telemetry(where: Settings, options: argparse.Namespace) -> int:
    stopped = _stopped_by_signals()
    show = telemetry.as_json if options.json else telemetry.as_text
    with Session(where) as session:
        telemetry.watch(
            session,
            options.names or None,
            seconds=options.seconds,
            stopped=stopped,
            show=show(sys.stdout),
        )
    return 0


def _info(where: Settings, options: argparse.Namespace) -> int:
    with Session(where) as session:
        for line in describe(session, options.timeout):
            print(line, flush=True)
    return 0


def _stopped_by_signals() -> threading.Event:
    stopped = threading.Event()
    for name in ("SIGINT", "SIGTERM", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: stopped.set())
    return stopped


def _snapshot(where: Settings, options: argparse.Namespace) -> int:
    try:
        from splatbus_viewer.snapshot import snapshot
    except ImportError as problem:
        print(problem, file=sys.stderr)
        return 1
    with Session(where) as session:
        pose = options.pose
        if options.camera_index is not None:
            pose = scene_camera(session, options.camera_index, options.timeout)
        snapshot(session, options.path, pose, options.timeout)
    print(options.path)
    return 0


def scene_camera(session: Session, index: int, timeout: float) -> Pose:
    """The pose of a camera of the scene; says which it is where there is none of that index."""
    pose = session.camera_pose(index, timeout)
    if "scene" in session.status.message.capabilities:
        count = session.scene(timeout).cameras
        if count and index % count != index:
            told = f"camera {index} is camera {index % count} of {count}, counted from 0"
            print(told, file=sys.stderr)
    return pose


def _parser() -> argparse.ArgumentParser:
    where = argparse.ArgumentParser(add_help=False)
    server = where.add_argument_group("server")
    server.add_argument("--host", metavar="NAME", help="host of the server (default: 127.0.0.1)")
    server.add_argument("--ipc-port", type=PORT, metavar="N", help="port of its IPC channel (6001)")
    server.add_argument(
        "--msg-port", type=PORT, metavar="N", help="port of its message channel (6000)"
    )
    server.add_argument(
        "--token-file",
        type=Path,
        metavar="PATH",
        help="file that holds the token; nobody but you may be able to read it (chmod 600)",
    )
    where.add_argument("-v", "--verbose", action="store_true", help="say more on standard error")

    parser = argparse.ArgumentParser(
        prog="splatbus-client",
        description="The reference client of the SplatBus protocol: watches a Gaussian-splatting\n"
        "renderer, steers its camera, takes pictures, and reads its figures.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=ShowVersion)
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    watch = commands.add_parser(
        "view",
        parents=[where],
        help="watch and steer without a window, until interrupted",
        description="Watches without a window. Sends camera poses along a small orbit, and reads"
        " every frame. Prints how many frames came, how fast, and how long after its pose each"
        " came (median and 99th percentile; a server of 1.1 says which image is the first to show"
        " which pose). Connects again whenever the server goes and comes back.",
    )
    watch.add_argument(
        "--rate",
        type=POSITIVE,
        default=30.0,
        metavar="HZ",
        help="camera poses to send per second (default: %(default)g)",
    )
    watch.add_argument(
        "--size",
        type=SIZE,
        metavar="WxH",
        help="size of the images to ask the server for, in pixels (default: as they are)",
    )
    _add_seconds(watch)
    watch.set_defaults(run=_view)

    window.add(commands, where)

    shoot = commands.add_parser(
        "snapshot",
        parents=[where],
        help="write one picture: colour, depth, and a composite with a mesh",
        description="Writes one picture with three panels: colour, with squares where nothing is;"
        " depth in false colour; and the image together with a ring that is partly in front of it"
        " and partly behind it. Without a pose, the picture shows what the server shows now.",
    )
    shoot.add_argument(
        "path", type=Path, metavar="FILE.png", help="file to write; the ending says its format"
    )
    pose = shoot.add_mutually_exclusive_group()
    pose.add_argument(
        "--pose",
        type=option(
            parse_pose, "numbers, a place and a quaternion, such as 0,-1,-3,0,0,0,1", "seven"
        ),
        metavar="X,Y,Z,QX,QY,QZ,QW",
        help="from this camera: place and rotation, camera-to-world; x right, y down, z forward;"
        " QW is the scalar",
    )
    pose.add_argument(
        "--look-at",
        type=option(
            parse_look_at,
            "numbers, the eye and another point to look at, such as 0,-1,-3,0,0,2",
            "six",
        ),
        dest="pose",
        metavar="EX,EY,EZ,TX,TY,TZ",
        help="from an upright camera at E that looks at T",
    )
    pose.add_argument(
        "--camera-index",
        type=WHOLE,
        metavar="N",
        help="from the scene's camera N, counted from 0; -1 is the last, and after the last it"
        " begins again",
    )
    _add_timeout(shoot)
    shoot.set_defaults(run=_snapshot)

    figures = commands.add_parser(
        "telemetry",
        parents=[where],
        help="print the server's figures live, until interrupted",
        description="Prints the server's figures as they come: a line for each series, which\n"
        "begins with the server's time. Numbers have their unit. Histograms have a bar for\n"
        "each bin, from the first edge to the last. A server that computes figures only while\n"
        "somebody asks for them does so while this runs. The window plots them.",
        epilog="examples:\n"
        "  splatbus-client telemetry                         everything\n"
        "  splatbus-client telemetry render_ms loss          these two series\n"
        "  splatbus-client telemetry --json > run.jsonl      for a plot, later\n"
        "  splatbus-client telemetry --seconds 60 | grep loss",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    figures.add_argument(
        "names", nargs="*", metavar="NAME", help="series to subscribe to (default: all)"
    )
    figures.add_argument(
        "--json", action="store_true", help="print each message as one line of JSON"
    )
    _add_seconds(figures)
    figures.set_defaults(run=_telemetry)

    about = commands.add_parser(
        "info",
        parents=[where],
        help="tell what the server can do, its scene and its clock",
        description="Asks a server which version it speaks, what it can do, what its scene"
        " consists of, what the numbers in its images mean and how old the newest image is, and"
        " compares its clock with ours.",
    )
    _add_timeout(about)
    about.set_defaults(run=_info)
    for command in commands.choices.values():
        command.set_defaults(command=command)
    return parser


def _add_seconds(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--seconds",
        type=POSITIVE,
        default=math.inf,
        metavar="N",
        help="stop after N seconds (default: run until SIGINT or SIGTERM)",
    )


def _add_timeout(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--timeout",
        type=POSITIVE,
        default=10.0,
        metavar="SECONDS",
        help="give up after this time (default: %(default)g)",
    )


if __name__ == "__main__":
    sys.exit(main())
