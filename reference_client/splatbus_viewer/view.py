"""A viewer without a window: steers along an orbit, reads every frame, says how it goes."""

from __future__ import annotations

import math
import secrets
import shutil
import threading
from collections import deque
from contextlib import suppress
from typing import Any, TextIO

from splatbus_client.channel import ChannelStatus
from splatbus_client.lease import FrameLease
from splatbus_client.loop import clock
from splatbus_client.mapping import MemoryLostError
from splatbus_client.session import Session
from splatbus_client.status import Status
from splatbus_wire.poses import IDENTITY, Pose
from splatbus_wire.rotations import rotation_matrix

from splatbus_viewer.latency import Latencies, percentiles
from splatbus_viewer.questions import Questions

ORBIT_SECONDS = 8.0
ORBIT_RADIUS = 0.25
OBJECT_SECONDS = 2.0
PATIENCE_SECONDS = 0.25
TERMINAL_SECONDS = 0.5
LINE_SECONDS = 5.0
_LONGEST_WAIT = 0.25
_LATELY = 200


def view(
    session: Session,
    *,
    rate: float,
    seconds: float,
    stopped: threading.Event,
    out: TextIO,
    size: tuple[int, int] | None = None,
) -> None:
    """Watch until `stopped` is set or `seconds` have passed.

    Args:
        session: with any server, or none yet.
        rate: camera poses to send, per second; fewer where images come more slowly [POS-12].
        seconds: how long to run; may be infinite.
        stopped: set by somebody else to end it.
        out: where the status goes: one line that is rewritten if a terminal, else plain lines.
        size: width and height in pixels that images are asked to have, on each connection.
    """
    questions, frames, report = Questions(session, size), _Frames(), _Report(out)
    start = next_pose = next_object = clock()
    shown = -1  # images, when the last pose was sent
    viewer, sent = secrets.token_hex(4), 0  # so that no other viewer's tags are taken for ours
    while not stopped.is_set() and (now := clock()) < start + seconds:
        if now >= next_object:
            session.send_object(IDENTITY)
            next_object = now + OBJECT_SECONDS
        if now >= next_pose and (frames.count != shown or now >= next_pose + PATIENCE_SECONDS):
            shown = frames.count or -1
            pose = orbit(questions.camera, now - start)
            sent += 1
            tag = f"{viewer}-{sent}" if session.status.message.version == "1.1" else None
            frames.latencies.asked_for(tag or pose, now)
            session.send_camera(pose, tag=tag)
            next_pose = max(next_pose, now - 1 / rate) + 1 / rate
        until = next_pose if now < next_pose else next_pose + PATIENCE_SECONDS
        _read_one(session, frames, min(until, start + seconds, now + _LONGEST_WAIT))
        questions.follow()
        report.update(session.status, frames, _size(session, questions))
    report.end(session.status, frames, _size(session, questions))


def orbit(center: Pose, seconds: float) -> Pose:
    """Return `center` moved along a small circle in its image plane, which begins at `center`."""
    angle = 2 * math.pi * seconds / ORBIT_SECONDS
    right, down = ORBIT_RADIUS * math.sin(angle), ORBIT_RADIUS * (1 - math.cos(angle))
    r = rotation_matrix(center.rotation)
    x, y, z = center.position
    return center._replace(
        position=(
            x + right * r[0] + down * r[1],
            y + right * r[3] + down * r[4],
            z + right * r[6] + down * r[7],
        )
    )


def _size(session: Session, questions: Questions) -> tuple[int, int]:
    """That of the images, and before there are any, what the server said."""
    images = session.images
    return questions.size if images is None else (images.width, images.height)


def _read_one(session: Session, frames: _Frames, until: float) -> None:
    """Read a frame if one comes in time, and otherwise wait as long."""
    try:
        frame = session.next_frame(max(0.0, until - clock()))
    except TimeoutError:
        return
    with frame, suppress(MemoryLostError):
        frames.read(frame, clock())


class _Frames:
    """What was read: how much, and how long after it was asked for."""

    def __init__(self) -> None:
        self.count = 0
        self.times: deque[float] = deque(maxlen=120)
        self.latencies = Latencies()

    def read(self, frame: FrameLease, now: float) -> None:
        """Copy the frame out, as a viewer does that uploads it to a texture.

        Raises:
            MemoryLostError: the server cut its memory short.
        """
        self.newest = frame.copy("color"), frame.copy("depth")
        self.count += 1
        self.times.append(now)
        if frame.has_camera:
            self.latencies.shown(frame.camera, now)

    def rate(self, now: float) -> float:
        """Return frames per second, over the last second."""
        return float(sum(time > now - 1.0 for time in self.times))


class _Report:
    """Writes how it goes: seldom enough not to be in the way, and at once when it changes."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._terminal = out.isatty()
        self._due = 0.0
        self._shown: tuple[Any, ...] = ()

    def update(self, status: Status, frames: _Frames, size: tuple[int, int]) -> None:
        """Write a line if one is due."""
        now = clock()
        state = (status, size)
        if now < self._due and (self._terminal or state == self._shown):
            return
        self._shown = state
        self._due = now + (TERMINAL_SECONDS if self._terminal else LINE_SECONDS)
        self._write(_line(status, frames, size, now))

    def end(self, status: Status, frames: _Frames, size: tuple[int, int]) -> None:
        """Write the last line."""
        self._write(_line(status, frames, size, clock()))
        if self._terminal:
            self._out.write("\n")

    def _write(self, line: str) -> None:
        if self._terminal:
            fitting = line[: shutil.get_terminal_size().columns - 1]
            self._out.write(f"\r\x1b[K{fitting}")
        else:
            self._out.write(f"{line}\n")
        self._out.flush()


def _line(status: Status, frames: _Frames, size: tuple[int, int], now: float) -> str:
    parts = [
        f"{frames.count} frames",
        f"{frames.rate(now):.0f}/s",
        _latency(list(frames.latencies.seconds)[-_LATELY:]),
        f"viewport {size[0]}x{size[1]}" if all(size) else "viewport unknown",
        f"IPC {_state(status.ipc)}",
        f"message {_state(status.message)}",
    ]
    problems = [
        "" if status.no_images is None else f"; no images: {status.no_images}",
        "" if status.no_effect is None else f"; {status.no_effect}",
    ]
    return ", ".join(parts) + "".join(problems)


def _latency(seconds: list[float]) -> str:
    if not seconds:
        return "latency -"
    median, late = percentiles(seconds)
    return f"latency {1e3 * median:.1f} ms (p99 {1e3 * late:.1f})"


def _state(channel: ChannelStatus) -> str:
    if not channel.connected:
        return f"not connected ({channel.problem or 'connecting'})"
    return channel.version or "connected"
