"""What there is to know of a server: what it speaks and can do, its scene, its clock."""

from __future__ import annotations

from collections.abc import Iterator

from splatbus_client.channel import ChannelStatus
from splatbus_client.clock import Sample, best
from splatbus_client.lease import FrameLease
from splatbus_client.loop import clock
from splatbus_client.session import Session
from splatbus_schemas.visible import visible
from splatbus_wire.messages import Scene, SceneObject

_PINGS = 9


def describe(session: Session, timeout: float) -> Iterator[str]:
    """Yield what a server says of itself, line by line.

    Raises:
        TimeoutError: it did not answer within `timeout` seconds; the message says why.
        ServerRefusedError: it answered a question with an error.
        NotOfferedError: it came back as another, which cannot do what the former could.
    """
    end = clock() + timeout
    width, height = session.viewport_size(timeout)
    yield from _channel("message", session.status.message)
    can, tick = session.status.message.capabilities, None
    if "ping" in can:
        tick = best([session.ping(end - clock()) for _ in range(_PINGS)])
        yield _row("clock", _compared(tick))
    if "scene" in can:
        yield from _scene(session.scene(end - clock()))
    yield _row("viewport", f"{width}x{height}")
    try:
        with session.next_frame(end - clock()) as frame:
            yield from _channel("IPC", session.status.ipc)
            yield from _images(frame, tick)
    except TimeoutError as problem:
        yield from _channel("IPC", session.status.ipc)
        yield _row("images", str(problem))


def _channel(name: str, status: ChannelStatus) -> Iterator[str]:
    if status.server is None:
        speaks = status.version or "not known yet" if status.connected else "not connected"
    else:
        speaks = f"{status.version}, {status.server.name} {status.server.version}"
    yield _row(name, speaks)
    if status.version == "1.1":
        yield _row("", f"capabilities: {', '.join(sorted(status.capabilities)) or 'none'}")


def _compared(tick: Sample) -> str:
    return (
        f"the server's is {tick.ahead:.6f} s ahead of ours, give or take {1e6 * tick.error:.0f} µs;"
        f" round trip {1e6 * tick.round_trip:.0f} µs, the best of {_PINGS}"
    )


def _scene(scene: Scene) -> Iterator[str]:
    times = scene.time_range
    yield _row(
        "scene",
        f"objects: {len(scene.objects)}, cameras: {scene.cameras}, "
        + ("nothing moves by itself" if times is None else f"time {times[0]:g} to {times[1]:g} s"),
    )
    if any(scene.origin):
        yield _row("", f"its own coordinates are the wire's + {_point(scene.origin)}")
    for each in scene.objects:
        yield _row("", _object(each))


def _object(each: SceneObject) -> str:
    name = f" ({each.name})" if each.name not in ("", each.id) else ""
    text = f"{each.id}{name}: {each.gaussians:,} Gaussians"
    if each.bounds is None:
        return text
    return f"{text} within {_point(each.bounds.min)} to {_point(each.bounds.max)}"


def _images(frame: FrameLease, tick: Sample | None) -> Iterator[str]:
    if not frame.has_camera:
        height, width = frame.depth.shape
        yield _row("images", f"{width}x{height}, of which 1.0 tells neither camera nor time")
        return
    camera, how = frame.camera, frame.semantics
    age = "" if tick is None else f", {1e3 * (clock() - tick.here(frame.rendered_at)):.1f} ms old"
    yield _row("images", f"{camera.width}x{camera.height}, the newest is number {frame.seq}{age}")
    yield _row(
        "",
        f"{how.alpha} alpha, {how.color_space} colour, {how.depth_kind} depth"
        f" ({how.depth_estimator}), {how.depth_empty:g} where nothing is",
    )
    yield _row("", f"from {_point(camera.pose.position)}, fx {camera.fx:g}, fy {camera.fy:g}")


def _point(place: tuple[float, ...]) -> str:
    return f"({', '.join(f'{coordinate:g}' for coordinate in place)})"


def _row(name: str, text: str) -> str:
    return visible(f"{name:<9} {text}")
