"""An image in device memory that the harness shows as a server of 1.0, and what is seen of a
client's reading it: its `calls` of the stand-in CUDA runtime, or what its adapter says that it
shows.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage, PlaneOffsets
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, GLANCE_SECONDS
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

BY_CALLS = ("stand-in", "returns:ipc")
BY_DIGEST = ("device", "returns:ipc", "adapter:digest")


@contextmanager
def image_of(
    trial: ClientTrial, width: int = 64, height: int = 48, layout: PlaneOffsets | None = None
) -> Iterator[DeviceImage]:
    """An image in device memory, drawn, with its event complete.

    In the end it is freed, after the connections that may know of it (CUD-4).
    """
    assert trial.device is not None, "a check of device memory needs a device"
    image = DeviceImage(trial.device, width, height, layout)
    try:
        image.draw(1)
        image.event.begin()
        image.event.complete()
        yield image
    finally:
        trial.role.offers_memory = False
        for connection in trial.peer.connections:
            if connection.channel == "ipc":
                connection.close()
        image.free()


def show(trial: ClientTrial, offered: Json) -> Connection:
    """A new IPC connection on which a server of 1.0 sends this init packet, as on those after."""
    trial.role.speaks, trial.role.device_packet, trial.role.offers_memory = "1.0", offered, True
    return trial.connection("ipc")


def is_shown(trial: ClientTrial, digests: tuple[str, str]) -> bool:
    """Whether the client shows the image of these digests, in what it reads of it."""
    answer = trial.ask("digest")
    if answer["seq"] is None:
        return False
    pairs = zip((answer["color"], answer["depth"]), digests, strict=True)
    read = [shown == right for shown, right in pairs if shown is not None]
    return bool(read) and all(read)


def reads(
    trial: ClientTrial, image: DeviceImage, place: str = "calls", seconds: float = EFFECT_SECONDS
) -> bool:
    """Whether the testee comes to read an image whole as it was drawn last, or its colour."""
    digests = image.painting().digests()

    def is_read() -> bool:
        if place == "calls":
            return image.is_read_whole(trial.calls())
        trial.rest(GLANCE_SECONDS)
        return is_shown(trial, digests)

    return trial.uses(is_read, seconds)


def expect_read(trial: ClientTrial, image: DeviceImage, place: str = "calls") -> None:
    """The check goes on only with a client that reads an image that is good in every way."""
    if not reads(trial, image, place):
        trial.not_observable("the testee did not read the image in good device memory")
