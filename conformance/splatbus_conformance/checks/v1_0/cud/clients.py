"""Checks on what a client does with device memory (spec 1.0 chapters 3 to 5), where the harness
plays a server of 1.0.
"""

from splatbus_conformance.cases.malformed.init_packets import ABSENT, changed
from splatbus_conformance.checks import CLIENT, CLIENT_CALLS, CLIENT_DEVICE, Cases, Place, check
from splatbus_conformance.images.memory.cuda_stand_in import usage
from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage, PlaneOffsets
from splatbus_conformance.images.memory.cuda_stand_in.trace import Call
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.shown_image import (
    BY_CALLS,
    BY_DIGEST,
    expect_read,
    image_of,
    is_shown,
    reads,
    show,
)
from splatbus_conformance.trials.trial import EFFECT_SECONDS, REACTION_SECONDS, SETTLE_SECONDS

EITHER = {CLIENT_DEVICE: BY_DIGEST, CLIENT_CALLS: BY_CALLS}
WATCHED_SECONDS = 0.5
NOWHERE = 99
"""Number of a device that there is not."""


@check("CUD-2", on={CLIENT: BY_CALLS})
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


@check("CUD-5", on={CLIENT: BY_CALLS})
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


@check("CUD-6", on={CLIENT: BY_CALLS})
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


@check("CHN-10", on={CLIENT: BY_CALLS})
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


@check("CHN-18", on={CLIENT: BY_CALLS})
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


@check("CHN-24", on=EITHER)
def check_reads_the_new_memory(trial: ClientTrial, place: Place) -> None:
    """The server comes back with memory of another size; that of before is there, and must not be
    read any more.
    """
    with image_of(trial) as old, image_of(trial, 31, 17) as new:
        new.draw(2)
        show(trial, old.init_packet())
        expect_read(trial, old, place)
        show(trial, new.init_packet())
        outcome = "accepts" if reads(trial, new, place) else trial.fate() or "ignores"
        trial.judge(outcome, "memory of 31x17 after a reconnect")
        before = len(old.copies(trial.calls()))
        old.draw(3)
        trial.rest(REACTION_SECONDS)
        if place == "device":
            stale = is_shown(trial, old.painting().digests())
            what = "it shows an image in memory of a connection that has ended"
            trial.expect(not stale, "stale-memory", what)
        for call in old.copies(trial.calls())[before:]:
            what = f"on the new connection it called {call} on the memory of before"
            trial.violated("stale-memory", what)


@check("CUD-6", on=EITHER, may_crash=True)
def check_opens_nothing_on_another_device(trial: ClientTrial, place: Place) -> None:
    """`meta.device` names a device that is not there, in a packet that is good otherwise; where it
    is absent, it is device 0.
    """
    assert trial.device is not None, "a check of device memory needs a device"
    with image_of(trial) as good, image_of(trial) as elsewhere:
        show(trial, good.init_packet())
        expect_read(trial, good, place)
        elsewhere.draw(7)
        show(trial, changed(elsewhere.init_packet(), {"meta/device": NOWHERE}))
        trial.expect(
            not reads(trial, elsewhere, place, 5 * REACTION_SECONDS),
            "another-device",
            f"it reads an image that is said to lie on device {NOWHERE}",
        )
        if trial.device.ordinal == 0:
            show(trial, changed(elsewhere.init_packet(), {"meta/device": ABSENT}))
            trial.expect(
                reads(trial, elsewhere, place),
                "default-not-applied",
                "it does not take an absent meta.device for 0",
            )


LAYOUTS = (
    ("no offsets", 64, 48, PlaneOffsets(None, None)),
    ("depth before colour in one allocation", 5, 7, PlaneOffsets(4096, 16, apart=False)),
    ("offsets in two allocations", 64, 48, PlaneOffsets(1 << 16, 4)),
    ("one pixel", 1, 1, PlaneOffsets(0, 16, apart=False)),
    ("the widest image", 32768, 1, PlaneOffsets()),
    ("the highest image", 1, 32768, PlaneOffsets()),
)


def seen_reading(trial: ClientTrial, place: Place) -> None:
    """A good image is read: what is not read after it is not understood."""
    with image_of(trial) as image:
        show(trial, image.init_packet())
        expect_read(trial, image, place)


@check("INI-8", on=EITHER, given=seen_reading, cases=Cases(LAYOUTS))
def check_reads_what_the_packet_names(
    trial: ClientTrial, place: Place, _: None, case: tuple[str, int, int, PlaneOffsets]
) -> None:
    """Offsets absent and present, planes in one allocation or two, sizes at both ends of their
    range; what the testee reads must be read from where it lies, whole.
    """
    what, width, height, layout = case
    with image_of(trial, width, height, layout) as image:
        image.draw(2 + trial.number)
        show(trial, image.init_packet())
        outcome = "accepts" if reads(trial, image, place) else trial.fate() or "ignores"
        trial.judge(outcome, f"an init packet with {what}: reading the image whole")
        for call in image.copies(trial.calls()):
            told = f"with {what} it copied what is no image: {call}"
            trial.expect(image.shows(call), "outside-the-image", told)
