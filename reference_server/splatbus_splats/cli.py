"""The command ``splatbus-server``: trained scenes, or spheres to try, over both channels."""

from __future__ import annotations

import argparse
import errno
import logging
import os
import signal
import sys
import threading
from importlib import import_module
from pathlib import Path
from typing import Any

from splatbus_renderer import cli as spheres
from splatbus_schemas import LIMITS
from splatbus_schemas.options import POSITIVE, joined
from splatbus_schemas.visible import worded
from splatbus_server.api import Bus, serve
from splatbus_server.view import Intrinsics
from splatbus_wire.messages import DEFAULT_OBJECT, SceneObject
from splatbus_wire.poses import Pose
from splatbus_wire.settings import read_token

from splatbus_splats.beginning import UPWARDS, USUAL_UP, before, lens_of, reaching
from splatbus_splats.drawing import gpu
from splatbus_splats.drawing.skips import MEANINGS, USUAL, Skip, named
from splatbus_splats.files.cameras import Camera, read_cameras
from splatbus_splats.gaussians import Vector
from splatbus_splats.loading import (
    Loaded,
    Progress,
    Source,
    cameras_near,
    loaded,
    scene_of,
    source,
    told,
)
from splatbus_splats.scene import Clip, Frames, Scene
from splatbus_splats.serving import SEMANTICS, Drawing, render_until

NAME = "splatbus-server"
SIZE = (640, 480)
RATE = 30.0
SECONDS = 50.0 / 30.0
"""Of a clip, whose file does not say: those that Spacetime Gaussians were published with have 50
pictures, 30 a second."""
NOT_TO_LISTEN_ON = (errno.EADDRINUSE, errno.EADDRNOTAVAIL, errno.EACCES)
"""What is wrong with an address, whatever memory is shared."""
SKIPS = "\n".join(f"  {each:9} {why}" for each, why in MEANINGS.items())
EPILOG = f"""\
examples:
  splatbus-server                             six spheres on 127.0.0.1, ports 6001 and 6000
  splatbus-server scene.ply                   a scene that you trained
  splatbus-server model                       a model's folder: its last iteration, its cameras
  splatbus-server room.ply statue.splat       two objects that clients can move, turn and scale
  splatbus-server walk --rate 25              a folder of numbered files, 25 a second
  splatbus-server dance.ply --seconds 10      Gaussians that live in time, for 10 seconds
  splatbus-server scene.ply --cameras cameras.json --size 1280x720
  splatbus-server scan.ply --up z             a scan in which z points up
  splatbus-server --ipc-port 0 --msg-port 0   let the system choose ports; the ready line says which
  splatbus-server --turntable 20              spheres that turn
  splatbus-server --host 0.0.0.0 --token-file ~/.splatbus-token
  python -m splatbus_splats.made 100000 garden.ply  make a scene, if you have none

files (need pip install 'splatbus-protocol[splats]'):
  .ply of 3DGS, also compressed, or with Gaussians that live in time (Spacetime Gaussians, lite);
  .splat, .spz, .sog, .ksplat, glTF. The first file is the object "default", which clients of 1.0
  can move too. The others are named after their files. An animated scene plays in a loop until a
  client sets the time.
  The view begins at the first camera of --cameras, or of a cameras.json beside the first file or
  in one of the three folders above it. Without one, the middle of the scene is in view.

drawing:
  gsplat draws on a GPU where it is installed. The first time, it compiles itself, which takes about
  a minute. Otherwise the processor draws, and saves work by these shortcuts (--skips hidden,tiles
  takes two; none, exact, usual and all are sets of them). They leave out:
{SKIPS}
  What each saves and costs is in benchmarks/SPLATS.md.

environment (an option wins over it):
  SPLATBUS_HOST, SPLATBUS_IPC_PORT, SPLATBUS_MSG_PORT   where to listen
  SPLATBUS_TOKEN                                        the token that clients have to send

what next:
  Wait for the line that begins with "splatbus-server ready". Then look, in another terminal:
      splatbus-client snapshot out.png            (needs the extra [client])
  Stop the server with Ctrl-C. What it reads and draws: reference_server/SPLATS.md. To serve your
  own renderer: reference_server/README.md.

exit codes: 0 stopped by SIGINT or SIGTERM, 1 a file cannot be read, an address is taken or memory
is full, 2 wrong usage
"""


def main(argv: list[str] | None = None) -> int:
    """Serves until SIGINT or SIGTERM; returns the exit code."""
    arguments = parser()
    words = joined(sys.argv[1:] if argv is None else argv, "--up")
    if any(each.startswith("--look-at") for each in words):
        arguments.error("--look-at is an option of splatbus-client snapshot, not of the server")
    options = arguments.parse_intermixed_args(words)
    if not options.files:
        for name in ("cameras", "rate", "seconds", "skips", "cpu", "up"):
            if getattr(options, name) is not None:
                arguments.error(f"--{name} is for files of Gaussians, and none is given")
        return spheres.main(argv)
    if options.turntable:
        arguments.error("--turntable is for the spheres; files are served without it")
    if len(options.files) > LIMITS["max_objects"]:
        arguments.error(f"{len(options.files)} files, where there are {LIMITS['max_objects']}")
    logging.basicConfig(
        format="%(asctime)s %(levelname)-7s %(message)s",
        level=logging.WARNING if options.quiet else logging.INFO,
    )
    sys.setswitchinterval(0.0005)  # reading and moving hold the interpreter's lock: replies wait
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        return _serve(options)
    except KeyboardInterrupt:  # until the server is ready
        return 0
    except ImportError as error:
        message = f"{error}: pip install 'splatbus-protocol[splats]'"
    except OSError as error:
        message = worded(error)
    except MemoryError as error:
        message = f"memory is full: {error}"
    except RuntimeError as error:
        if type(error).__name__ != "OutOfMemoryError":  # PyTorch's, which may not be here
            raise
        message = "memory of the GPU is full: --cpu draws on the processor"
    except ValueError as error:
        message = str(error)
    print(f"{NAME}: {message}", file=sys.stderr)
    return 1


def parser() -> argparse.ArgumentParser:
    """The options of the spheres, and those of files."""
    parser = spheres.parser()
    parser.description = (
        "Serve trained scenes of Gaussians over SplatBus 1.0 and 1.1; or without files, a small"
        " scene to try viewers with."
    )
    parser.epilog = EPILOG
    parser.set_defaults(size=None)
    parser.add_argument(
        "files",
        nargs="*",
        type=Path,
        metavar="FILE",
        help="file of Gaussians, or a folder: see below; without one, spheres are served",
    )
    parser.add_argument(
        "--cameras",
        type=Path,
        metavar="JSON",
        help="cameras.json of 3DGS; the view begins at the first (default: one near the file)",
    )
    parser.add_argument(
        "--up",
        choices=UPWARDS,
        metavar="AXIS",
        help=f"the axis that points up: {', '.join(UPWARDS)} (default: what the file says, or "
        f"{USUAL_UP}); used only without cameras",
    )
    parser.add_argument(
        "--rate",
        type=POSITIVE,
        help=f"files a second, for a folder of numbered files (default: {RATE:g})",
    )
    parser.add_argument(
        "--cpu",
        action="store_true",
        default=None,
        help="draw on the processor even where gsplat could draw on a GPU",
    )
    parser.add_argument(
        "--skips",
        type=_skips,
        metavar="NAMES",
        help="shortcuts that the processor takes (default: usual): see below",
    )
    parser.add_argument(
        "--seconds",
        type=POSITIVE,
        help="length in seconds of a file whose Gaussians live in time (default: "
        f"{SECONDS:.3g}, which is 50 images at 30 a second)",
    )
    return parser


def _serve(options: argparse.Namespace) -> int:
    """Serves files.

    Raises:
        ValueError: a file is not what it has to be.
        OSError: a file cannot be read, an address is taken or memory is full.
        ImportError: the extra is not installed.
        KeyboardInterrupt: it is stopped before it is ready.
    """
    # What can be wrong without it is looked at before what takes long.
    size = options.size or SIZE
    try:
        token = None if options.token_file is None else read_token(options.token_file)
    except ValueError as error:
        return _misused(error)
    sources = [source(each) for each in options.files]
    taken, where = _cameras(sources[0], options.cameras)
    why_not = "--cpu" if options.cpu else gpu.why_not()
    if why_not:  # the processor draws, which needs an extra: better said before reading
        import_module("splatbus_splats.drawing.processor")
    if options.skips is None:
        options.skips = USUAL
    rate, seconds = options.rate or RATE, options.seconds or SECONDS
    progress = None if options.quiet else _progress()
    objects = loaded(sources, rate, seconds, progress)
    *_, origin, up = objects[DEFAULT_OBJECT]
    kinds = {type(each.part) for each in objects.values() if each.part.last}
    summary = [_summary(name, each) for name, each in objects.items()]
    doubts = [f"{each.label}: {doubt}" for each in objects.values() for doubt in each.doubts]
    doubts += [
        f"--{name} is not used: {why}"
        for name, why, is_used in (
            ("up", f"the view begins at a camera of {where}", not taken),
            ("rate", "no folder of several numbered files is given", Frames in kinds),
            ("seconds", "no file has Gaussians that live in time", Clip in kinds),
        )
        if getattr(options, name) is not None and not is_used
    ]
    if not any(each.part.most for each in objects.values()):
        raise ValueError(f"there is nothing to show: {', '.join(summary)}")
    scene = scene_of(objects)
    up = options.up or up or USUAL_UP
    cameras, lens, why = _beginning(_counted_from(origin, taken), where, scene, size, up)
    if origin.any():
        summary.append(f"positions are counted from {tuple(origin.tolist())}, the scene's origin")
    for doubt in doubts:
        print(f"{NAME}: {doubt}", file=sys.stderr)
    if not options.quiet:
        for each in summary:
            print(each, file=sys.stderr)
        print(f"the view begins {why}", file=sys.stderr, flush=True)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    try:
        bus, drawing = _served(
            options,
            why_not,
            scene,
            *size,
            intrinsics=lens,
            cameras=cameras,
            semantics=SEMANTICS._replace(origin=tuple(origin.tolist())),
            objects=[
                SceneObject(name, told(each.label), each.part.most, each.part.bounds)
                for name, each in objects.items()
            ],
            time_range=scene.time_range,
            host=options.host,
            ipc_port=options.ipc_port,
            message_port=options.msg_port,
            token=token,
        )
    except ValueError as error:
        return _misused(error)
    with bus:
        address = bus.address
        print(
            f"{NAME} ready on {address.host}: IPC port {address.ipc_port},"
            f" message port {address.message_port}, {size[0]}x{size[1]}",
            flush=True,
        )
        render_until(stop, bus, scene, drawing, options.fps)
    logging.getLogger("splatbus_server").info("stopped: %s", bus.statistics)
    return 0


def _misused(error: ValueError) -> int:
    print(f"{NAME}: {error}", file=sys.stderr)
    return 2


def _served(
    options: argparse.Namespace, why_not: str | None, scene: Scene, *size: int, **given: Any
) -> tuple[Bus, Drawing]:
    """A bus and what draws for it: gsplat on a GPU, or the processor for a reason."""
    if why_not is None:
        try:
            bus = serve(*size, memory="cuda_ipc", **given)
            _say(options, "drawn by gsplat, and shared on the GPU")
            return bus, gpu.Renderer()
        except (ImportError, OSError) as error:  # a platform that shares no memory of a GPU
            if getattr(error, "errno", None) in NOT_TO_LISTEN_ON:
                raise
            why_not = str(error)
    from splatbus_splats.drawing.processor import Processor  # needs the extra

    _say(options, f"drawn on the processor ({why_not})")
    _say(options, "preparing to draw: the first time on a machine this takes up to a minute")
    processor = Processor(os.cpu_count() or 1, options.skips)
    processor.prepare(scene.at(None).values())
    return serve(*size, **given), processor


def _say(options: argparse.Namespace, text: str) -> None:
    if not options.quiet:
        print(text, file=sys.stderr, flush=True)


def _progress() -> Progress:
    """Says on standard error how much is read, at every tenth."""
    said = 0

    def progress(path: Path, number: int, whole: int, share: float) -> None:
        nonlocal said
        if (tenths := int(10.0 * share)) > said:
            text = f"reading {path}, file {number} of {whole}: {tenths}0% read"
            print(text, file=sys.stderr, flush=True)
            said = tenths

    return progress


def _cameras(first: Source, given: Path | None) -> tuple[list[Camera], str]:
    """The cameras, and which file they are of; or none, and why."""
    path = given or cameras_near(first.files[0])
    if path is None:
        return [], "no cameras.json is given or near the file"
    try:
        return read_cameras(path), str(path)
    except (OSError, ValueError) as error:
        if given is not None:
            raise
        return [], f"the one near the file is not used ({worded(error)})"


def _counted_from(origin: Vector, cameras: list[Camera]) -> list[Camera]:
    moved = []
    for each in cameras:
        position = tuple((each.pose.position - origin).tolist())
        moved.append(each._replace(pose=each.pose._replace(position=position)))
    return moved


def _beginning(
    taken: list[Camera], where: str, scene: Scene, size: tuple[int, int], up: str
) -> tuple[list[Pose], Intrinsics, str]:
    """Where cameras are, the lens of the first, and where that is and why, in words."""
    if taken:
        camera = taken[0]
        why = (
            f"at {_point(camera.pose.position)}, where {camera.name} was taken:"
            f" the first of {len(taken)} cameras of {where}"
        )
        lens = reaching(lens_of(camera, *size), camera.pose.position, scene.bounds)
        return [each.pose for each in taken], lens, why
    pose, lens = before(scene, *size, up)
    why = (
        f"at {_point(pose.position)}, with {up} upwards and the middle of the scene in view:"
        f" {where}"
    )
    return [pose], lens, why


def _summary(name: str, object_: Loaded) -> str:
    label, part, left_out, *_ = object_
    box = part.bounds
    where = f", from {_point(box.min)} to {_point(box.max)}" if box else ""
    without = "".join(f"; {count:,} left out: {why}" for why, count in left_out.items())
    time = ""
    if isinstance(part, Frames) and part.last:
        time = f"{len(part.files)} files in {part.loop:.4g} s, with up to "
    elif part.last:
        time = f"{part.last:.4g} s, with "
    return (
        f"{name} ({label}): {time}{part.most:,} Gaussians of degree {part.degree}{where}{without}"
    )


def _point(point: Any) -> str:
    return f"({', '.join(f'{each:.4g}' for each in point)})"


def _skips(text: str) -> Skip:
    try:
        return named(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
