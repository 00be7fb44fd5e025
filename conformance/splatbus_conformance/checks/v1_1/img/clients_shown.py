"""Checks on what a client shows of frames in device memory (spec 1.1 chapters 3 to 5).

They see no calls, only what comes of them, so that they judge on a GPU as on the stand-in. Whatever
is not lent, and whatever has an event that is pending, holds what nobody may show.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from splatbus_conformance.cases.malformed.handles import UNKNOWN_HANDLE
from splatbus_conformance.cases.malformed.init_packets import changed
from splatbus_conformance.checks import CLIENT, Cases, check
from splatbus_conformance.checks.v1_1.img import adapter as adapter_images
from splatbus_conformance.images.memory.cuda_stand_in.ring import DeviceRing
from splatbus_conformance.images.memory.device import STAND_IN
from splatbus_conformance.images.painted import coordinates
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.frame_lender import FrameLender
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet

OPENS = ("device", "returns:ipc", "capability:cuda_ipc")
READS = (*OPENS, "capability:frames", "adapter:digest")
PENDING_SECONDS = 0.2
NOBODY = "GPU-00000000-0000-4000-8000-00000000dead"


@contextmanager
def ring_for(trial: ClientTrial) -> Iterator[DeviceRing]:
    """A ring in device memory, which is what this trial offers; freed in the end (OPN-8)."""
    assert trial.device is not None, "a check of device memory needs a device"
    role = trial.role
    ring = DeviceRing(trial.device, role.width, role.height, role.slots)
    role.offer_on_device(ring)
    try:
        yield ring
    finally:
        role.offers_memory = False
        trial.peer.close_all()
        ring.free()


@check(
    "IMG-8",
    on={CLIENT: READS},
    given=ring_for,
)
def check_shows_a_frame_after_its_event(trial: ClientTrial, ring: DeviceRing) -> None:
    """In every slot the event is pending for a while after the frame is lent. Until then the slot
    holds what nobody may show, and the events of all others are complete.
    """
    lender = FrameLender(trial)
    released = trial.role.with_(lender.connection).released
    for number in range(2 * trial.role.slots):
        image = coordinates(number, *lender.size)
        seq, slot = lender.announced(image)
        ring.events[slot].begin()
        trial.lend(lender.connection)
        trial.rest(PENDING_SECONDS)
        early = seq in released
        lender.paint(image, slot)
        ring.events[slot].complete()
        if not trial.releases(lender.connection, seq):
            trial.not_observable("the testee did not give an image back")
        answer = lender.newest()
        if answer["seq"] != seq:
            trial.not_observable("the client gives frames back, and does not read them")
        if wrong := adapter_images.parts(answer, image):
            told = " and was released" if early else ""
            trial.violated(
                "read-before-event",
                f"image {seq} was read{told} before the event of slot {slot} was complete: "
                + adapter_images.described(answer, wrong, lender),
            )


@check(
    "IMG-13",
    on={CLIENT: READS},
    given=ring_for,
)
def check_releases_when_it_has_read_the_device(trial: ClientTrial, _: DeviceRing) -> None:
    """Images are lent in device memory, one after the other, as fast as they come back; each slot
    is written over in the moment in which it is released.
    """
    adapter_images.check_releases_when_it_has_read(trial)


@check(
    "IMG-14",
    on={CLIENT: READS},
    given=ring_for,
)
def check_reads_only_what_it_holds_of_the_device(trial: ClientTrial, _: DeviceRing) -> None:
    """After an image in device memory was given back, every slot is written over; the client shows
    the one that it read, or none.
    """
    adapter_images.check_reads_only_what_it_holds(trial)


@check(
    "CHN-18",
    on={CLIENT: READS},
    given=ring_for,
)
def check_leaves_the_device_when_the_connection_ends(trial: ClientTrial, _: DeviceRing) -> None:
    """The IPC connection ends, while an image in device memory is lent and while none is, and every
    slot is written over.
    """
    adapter_images.check_leaves_the_buffers_when_the_connection_ends(trial)


@check("OPN-1", on={CLIENT: OPENS}, given=ring_for)
def check_opens_device_memory(trial: ClientTrial, _: DeviceRing) -> None:
    """A ring whose allocation, events and device are there: a client that declares `cuda_ipc` is
    able to open it, once and again on the next connection.
    """
    for _time in range(2):
        connection = trial.greeted("ipc")
        dealings = trial.role.with_(connection)
        trial.opens(connection)
        heard = [message for message in dealings.heard if message.get("type") == "open_failed"]
        reason = heard[0].get("reason") if heard else "it did not answer"
        trial.expect(
            dealings.opened,
            "open-failed" if heard else "no-reply",
            f"it did not open good device memory: {reason}",
        )


def unusable(trial: ClientTrial, ring: DeviceRing) -> Cases:
    """Init packets that differ from a good one in what they name, which is not there."""
    assert trial.device is not None, "a check of device memory needs a device"
    # Freed while the other is there, which could otherwise have its place, and its handle.
    gone = DeviceRing(trial.device, trial.role.width, trial.role.height, trial.role.slots)
    freed = gone.init_packet(1)
    gone.free()
    good = ring.init_packet(1)
    events = good["ring"]["events"]
    found: dict[str, dict[str, object]] = {
        "a device that is not there": {"memory/deviceUuid": NOBODY},
        "an unknown handle of memory": {"memory/handle": UNKNOWN_HANDLE},
        "an unknown handle of an event": {"ring/events": [*events[:-1], UNKNOWN_HANDLE]},
        "memory that was freed": {"memory": freed["memory"], "ring": freed["ring"]},
    }
    if trial.facts.device == STAND_IN:
        del found["a device that is not there"]
    return Cases(list(found.items()))


@check(
    "INI-13",
    on={CLIENT: OPENS},
    given=ring_for,
    cases=unusable,
    may_crash=True,
)
def check_goes_on_without_device_memory(
    trial: ClientTrial, ring: DeviceRing, case: tuple[str, dict[str, object]]
) -> None:
    """A device that is not there (on a GPU: the stand-in tells nobody its UUID), memory that was
    freed, handles that the driver does not know.
    """
    what, changes = case
    trial.role.offers_memory = False
    connection = trial.for_init_packet()
    generation = trial.role.next_generation(connection)
    offered = changed(ring.init_packet(1), changes) | {"generation": generation}
    outcome = trial.outcome_on_ipc(connection, packet(encode(offered)))
    meaning = {"ignores": "waits", "declines": "waits", "closes": "reconnects"}
    trial.judge(meaning.get(outcome, outcome), f"an init packet with {what}")
