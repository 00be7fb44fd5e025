"""Checks on what a server of 1.0 stores in its images (spec 1.0 chapter 5).

They are read through the handles of its init packets, on a GPU or in the stand-in's memory.
"""

import base64
import contextlib
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.images.captured import LEGACY_EMPTY
from splatbus_conformance.images.memory.device import Device
from splatbus_conformance.images.memory.reading import MOST_PIXELS, Pixels
from splatbus_conformance.rules.v1_0.ini import layout
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.json_values import within
from splatbus_conformance.wire.messages import Json

IMAGES, PAUSE_SECONDS = 8, 0.05
SMALLEST = float(np.finfo(np.float32).tiny)
MOST = 0.5
"""With fewer sensible numbers than this an image is read in the wrong order of bytes, if the other
order makes sense of them all."""
MEMBERS = {"mem_color": ("offsetColor", 4), "mem_depth": ("offsetDepth", 1)}
"""Where each plane is named and begins, and how many numbers of it are a pixel's."""
SHOWN = ("cuda", "device")


class BufferContents(NamedTuple):
    """What lay in the buffers of 1.0 at one moment; it may be of two images (section 5.4)."""

    color: Pixels
    """(h, w, 4) float32, rows top-down."""
    depth: Pixels
    """(h, w) float32, rows top-down."""


@contextlib.contextmanager
def reading(trial: ServerTrial) -> Iterator[Callable[[], BufferContents]]:
    """What reads the buffers of 1.0, once the server has drawn an image."""
    packet = init_packet_of(trial)
    handles = {name: base64.b64decode(packet[name]) for name in (*MEMBERS, "evt_done")}
    width, height = int(packet["meta"]["w"]), int(packet["meta"]["h"])
    device = device_of(trial, packet)

    def plane(member: str) -> Pixels:
        offset, numbers = MEMBERS[member]
        begin, size = int(packet["meta"].get(offset, 0)), 4 * numbers * width * height
        try:
            data = device.read(handles[member], begin, size, handles["evt_done"])
        except ValueError as error:
            trial.not_observable(f"what {member} names cannot be read: {error}")
        return np.frombuffer(data, np.dtype("<f4")).reshape(height, width, numbers)[::-1]

    def both() -> BufferContents:
        return BufferContents(plane("mem_color"), plane("mem_depth")[..., 0])

    try:
        if not trial.wait(lambda: all(map(drawn, both()))):
            trial.not_observable(f"in {EFFECT_SECONDS:g} s it wrote no image")
        yield both
    finally:
        for handle in handles.values():
            device.forget(handle)


def stored(trial: ServerTrial) -> list[BufferContents]:
    """Images while the camera moves, once the server has drawn one."""
    found = []
    with reading(trial) as both:
        for _ in range(IMAGES):
            trial.move()
            trial.rest(PAUSE_SECONDS)
            found.append(both())
    trial.delivered += len(found)
    return found


def init_packet_of(trial: ServerTrial) -> Json:
    """The init packet of a new connection, if it names an image as 1.0 says."""
    connection = trial.dial("ipc")
    dealings = trial.viewer.with_(connection)
    trial.wait(lambda: dealings.init_packets or connection.ended)
    if not dealings.init_packets:
        trial.not_observable("the server sent no init packet")
    packet = dealings.init_packets[0]
    broken = [found for found in layout(packet) if found.breach]
    if broken or packet["meta"]["w"] * packet["meta"]["h"] > MOST_PIXELS:
        why = broken[0].breach if broken else "its images are too large"
        trial.not_observable(f"its init packet is none to read images by: {why}")
    return packet


def device_of(trial: ServerTrial, packet: Json) -> Device:
    """Where its images lie: the server's count of devices need not be that of the harness."""
    assert trial.device is not None, "a check of device memory needs a device"
    uuid = within(packet, "memory", "deviceUuid")
    try:
        return trial.device if uuid is None else trial.device.named(uuid)
    except ValueError as error:
        trial.not_observable(str(error))


def drawn(pixels: Pixels) -> bool:
    """Somebody has written there: not all of it is poison."""
    return bool((pixels.view(np.uint32) != 0xFFFFFFFF).any())


def first_of(wrong: NDArray[np.bool_], pixels: Pixels) -> str:
    """How many are wrong, and the first of them."""
    row, column, *_ = np.argwhere(wrong)[0]
    return f"{wrong.sum()} of {wrong.size}, {pixels[wrong][0]} at row {row}, column {column}"


@check(
    "BUF-2", observable="whether the numbers make sense byte by byte in reverse", on={SERVER: SHOWN}
)
def check_numbers_in_device_memory_are_little_endian(trial: ServerTrial) -> None:
    """Colours that are from 0 to 1 only if their bytes are read from the other end."""
    for color, _ in stored(trial):
        right, swapped = sensible(color), sensible(color.byteswap())
        reversed_ = swapped == 1.0 and right < MOST and color.any()
        trial.expect(
            not reversed_, "big-endian", "colours are from 0 to 1 if they are read as big-endian"
        )


def sensible(color: Pixels) -> float:
    """The share of the numbers other than 0 that are colours, and not as good as 0."""
    numbers = color[color != 0]
    with np.errstate(invalid="ignore"):
        return float(((numbers >= SMALLEST) & (numbers <= 1.0)).mean()) if numbers.size else 1.0


@check("BUF-3", observable="every colour of some images", on={SERVER: SHOWN})
def check_colours_in_device_memory_are_from_0_to_1(trial: ServerTrial) -> None:
    """Every number of every pixel."""
    for color, _ in stored(trial):
        wrong = ~in_range(color)
        if wrong.any():
            trial.violated(
                "out-of-range", f"colours that are not from 0 to 1: {first_of(wrong, color)}"
            )


@check("BUF-5", observable="alpha where something is seen", on={SERVER: SHOWN})
def check_alpha_in_device_memory_is_1_where_there_is_none(trial: ServerTrial) -> None:
    """Alpha that is the same everywhere in all images was not rendered: then it is 1."""
    images = stored(trial)
    alphas = {float(alpha) for image in images for alpha in np.unique(image.color[..., 3])}
    if not any((np.isfinite(depth) & (depth != LEGACY_EMPTY)).any() for _, depth in images):
        trial.not_observable("nothing is seen in its images")
    if len(alphas) == 1:
        trial.expect(
            alphas == {1.0},
            "wrong-alpha",
            f"alpha is {alphas.pop()} in every pixel of {IMAGES} images",
        )


@check(
    "BUF-7", observable="depths that are no depth, and those where alpha is 0", on={SERVER: SHOWN}
)
def check_depths_in_device_memory_are_positive(trial: ServerTrial) -> None:
    """Every depth is positive or +∞. That pixels without alpha are empty is told only of servers
    that speak 1.1, since colour and depth of 1.0 may be of different images.
    """
    for _, depth in stored(trial):
        with np.errstate(invalid="ignore"):
            wrong = ~(depth > 0)
        if wrong.any():
            trial.violated(
                "not-a-depth", f"depths that are neither positive nor +∞: {first_of(wrong, depth)}"
            )


def in_range(color: Pixels) -> NDArray[np.bool_]:
    """(h, w, 4): from 0 to 1."""
    with np.errstate(invalid="ignore"):
        found: NDArray[np.bool_] = (color >= 0.0) & (color <= 1.0)
    return found
