"""Checks on what a client does with device memory (spec 1.0 chapters 3 to 5).

The stand-in CUDA runtime tells what the client called; the harness plays a server of 1.0.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from splatbus_conformance.cases.malformed.init_packets import ABSENT, changed
from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.images.memory.cuda_stand_in import usage
from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage, PlaneOffsets
from splatbus_conformance.images.memory.cuda_stand_in.trace import Call
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, REACTION_SECONDS, SETTLE_SECONDS
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

RETURNS = ("stand-in", "returns:ipc")
PENDING_SECONDS = 0.3
WATCHED_SECONDS = 0.5


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


def expect_read(trial: ClientTrial, image: DeviceImage) -> None:
    """The check goes on only with a client that reads all of the colour that it is shown."""
    if not reads(trial, image):
        trial.not_observable("the testee did not read the image in good device memory")


def reads(trial: ClientTrial, image: DeviceImage) -> bool:
    """Whether the testee reads the whole colour as it was drawn."""
    return trial.uses(lambda: image.is_read_whole(trial.calls()))


@check("BUF-11", on={CLIENT: RETURNS})
def check_waits_for_the_event(trial: ClientTrial) -> None:
    """The event of the image is pending for a third of a second, and the memory is poison until it
    is done; before each copy of the same bytes the stream, or the host, must wait.
    """
    with image_of(trial) as image:
        image.event.begin()
        for plane in image.planes.values():
            plane.memory.poison()
        show(trial, image.init_packet())
        trial.uses(lambda: image.opened(trial.calls()))
        trial.rest(PENDING_SECONDS)
        for call in image.copies(trial.calls()):
            trial.violated("read-before-event", f"while the event was pending it called {call}")
        image.draw(2)
        image.event.complete()
        expect_read(trial, image)
        trial.rest(REACTION_SECONDS)
        assert trial.stand_in is not None
        for call in usage.unwaited(trial.stand_in.calls()):
            if call.memory in image.names:
                trial.violated("not-waited", f"its stream did not wait for the event before {call}")


@check("CUD-2", on={CLIENT: RETURNS})
def check_opens_each_handle_once(trial: ClientTrial) -> None:
    """Colour and depth in one allocation, then in two, then in one again on a new connection, and
    in one where depth comes first.
    """
    with (
        image_of(trial) as image,
        image_of(trial, layout=PlaneOffsets()) as apart,
        image_of(trial, 5, 7, PlaneOffsets(4096, 16, apart=False)) as turned,
    ):
        for shown in (image, apart, image, turned):
            show(trial, shown.init_packet())
            expect_read(trial, shown)
            for call in usage.opened_again(trial.calls()):
                trial.violated("opened-again", f"it had the memory open when it called {call}")


@check("CUD-5", on={CLIENT: RETURNS})
def check_gives_memory_back(trial: ClientTrial) -> None:
    """The connection is closed, then reset, while the testee reads; it is given 5 seconds."""
    for end in ("close", "reset"):
        with image_of(trial) as image:
            connection = show(trial, image.init_packet())
            expect_read(trial, image)
            trial.role.offers_memory = False
            getattr(connection, end)()
            trial.wait(lambda: not held(trial, image))
            if trial.fate():
                trial.not_observable("its process ended with the connection")
            left = ", ".join(held(trial, image))
            trial.expect(
                not left,
                "memory-left-behind",
                f"{EFFECT_SECONDS:g} s after its connection it holds {left}",
            )
            for call in usage.closed_while_reading(trial.calls()):
                trial.violated(
                    "closed-while-reading",
                    f"it had not seen its copies finish when it called {call}",
                )


def held(trial: ClientTrial, image: DeviceImage) -> list[str]:
    """What of an image the testee has open, in words."""
    words = dict.fromkeys(image.names, "memory") | {image.event.name: "the event"}
    return [words[name] for _, name in usage.held(trial.calls()) if name in words]


@check("CUD-6", on={CLIENT: RETURNS})
def check_opens_on_the_device_named(trial: ClientTrial) -> None:
    """`meta.device` is 1, then absent, then 0; there are two devices."""
    for named, device in ((1, 1), (ABSENT, 0), (0, 0)):
        with image_of(trial) as image:
            show(trial, changed(image.init_packet(), {"meta/device": named}))
            expect_read(trial, image)
            opening = [c for c in trial.calls() if _opens(c, image)]
            for call in opening:
                what = "absent" if named is ABSENT else named
                trial.expect(
                    call.device == device,
                    "another-device",
                    f"meta.device is {what}; it called {call}",
                )


def _opens(call: Call, image: DeviceImage) -> bool:
    """It opens memory of an image, or its event."""
    event = call.function == "cudaIpcOpenEventHandle" and call.event == image.event.name
    return event or bool(call.opened and call.memory in image.names)


@check("CHN-10", on={CLIENT: RETURNS})
def check_keeps_the_ipc_connection_while_it_reads(trial: ClientTrial) -> None:
    """The testee reads; its connection is watched for half a second, and until it reads again."""
    with image_of(trial) as image:
        connection = show(trial, image.init_packet())
        expect_read(trial, image)
        trial.ends(connection, WATCHED_SECONDS)
        trial.rest(SETTLE_SECONDS)
        before = len(image.copies(trial.calls()))
        if not trial.uses(lambda: len(image.copies(trial.calls())) > before):
            trial.not_observable("the testee reads the image once, and not again")
        trial.expect(
            not connection.ended, "closes", "it reads on after it closed the IPC connection"
        )


@check("CHN-18", on={CLIENT: RETURNS})
def check_leaves_the_buffers_of_an_ended_connection(trial: ClientTrial) -> None:
    """The connection is closed while the testee reads, and no further init packet comes; whoever
    has not given the memory back after 5 seconds must at least have stopped to read it.
    """
    with image_of(trial) as image:
        connection = show(trial, image.init_packet())
        expect_read(trial, image)
        trial.role.offers_memory = False
        connection.close()
        trial.wait(lambda: not held(trial, image))
        before = len(image.copies(trial.calls()))
        trial.rest(REACTION_SECONDS)
        for call in image.copies(trial.calls())[before:]:
            trial.violated(
                "stale-memory", f"{EFFECT_SECONDS:g} s after its connection ended it called {call}"
            )


@check("CHN-24", on={CLIENT: RETURNS})
def check_reads_the_new_memory(trial: ClientTrial) -> None:
    """The server comes back with memory of another size; that of before is there, and must not be
    read any more.
    """
    with image_of(trial) as old, image_of(trial, 31, 17) as new:
        show(trial, old.init_packet())
        expect_read(trial, old)
        show(trial, new.init_packet())
        outcome = "accepts" if reads(trial, new) else trial.fate() or "ignores"
        trial.judge(outcome, "memory of 31x17 after a reconnect")
        before = len(old.copies(trial.calls()))
        trial.rest(REACTION_SECONDS)
        for call in old.copies(trial.calls())[before:]:
            trial.violated(
                "stale-memory", f"on the new connection it called {call} on the memory of before"
            )


LAYOUTS = (
    ("no offsets", 64, 48, PlaneOffsets(None, None)),
    ("depth before colour in one allocation", 5, 7, PlaneOffsets(4096, 16, apart=False)),
    ("offsets in two allocations", 64, 48, PlaneOffsets(1 << 16, 4)),
    ("one pixel", 1, 1, PlaneOffsets(0, 16, apart=False)),
    ("the widest image", 32768, 1, PlaneOffsets()),
    ("the highest image", 1, 32768, PlaneOffsets()),
)


@check("INI-8", on={CLIENT: RETURNS})
def check_reads_what_the_packet_names(trial: ClientTrial) -> None:
    """Offsets absent and present, planes in one allocation or two, sizes at both ends of their
    range; the colour must be copied from where it lies, whole.
    """
    for what, width, height, layout in trial.each(LAYOUTS):
        with image_of(trial, width, height, layout) as image:
            show(trial, image.init_packet())
            outcome = "accepts" if reads(trial, image) else trial.fate() or "ignores"
            trial.judge(outcome, f"an init packet with {what}: reading the colour whole")
            for call in image.copies(trial.calls()):
                trial.expect(
                    image.shows(call),
                    "outside-the-image",
                    f"with {what} it copied what is no image: {call}",
                )
