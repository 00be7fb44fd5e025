"""Checks on how a client reads frames in device memory (spec 1.1 chapter 5)."""

from collections.abc import Iterator
from contextlib import contextmanager

from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.images.memory.cuda_stand_in import usage
from splatbus_conformance.images.memory.cuda_stand_in.ring import DeviceRing
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.sockets import Connection

LENDING = ("stand-in", "returns:ipc", "capability:cuda_ipc", "capability:frames")
PENDING_SECONDS = 0.2
FRAMES = 12


@contextmanager
def ring_of(trial: ClientTrial) -> Iterator[tuple[DeviceRing, Connection]]:
    """A ring in device memory, and the connection on which the testee has opened it."""
    assert trial.device is not None, "a check of device memory needs a device"
    role = trial.role
    role.welcomes = role.offers_memory = role.lends_frames = False
    ring = DeviceRing(trial.device, role.width, role.height, role.slots)
    try:
        connection = trial.connection("ipc")
        role.offer(connection, ring.init_packet(role.next_generation(connection)))
        if not trial.says_hello(connection):
            trial.not_observable("the testee said no hello on this connection")
        role.welcome(connection, capabilities=["cuda_ipc", "frames"])
        if not trial.opens(connection):
            trial.not_observable("the testee did not open the ring in device memory")
        yield ring, connection
    finally:
        trial.peer.close_all()
        ring.free()


def lend(trial: ClientTrial, ring: DeviceRing, connection: Connection) -> tuple[int, int]:
    """Lend the next slot, drawn and complete; its slot and its `seq`."""
    slot = trial.role.coming(connection).slot
    ring.fill(slot, b"\0")
    ring.events[slot].begin()
    ring.events[slot].complete()
    return slot, trial.lend(connection)


def released_at(trial: ClientTrial, connection: Connection, seq: int) -> float:
    """When the release of a frame had arrived; skips the check if none does."""
    if not trial.releases(connection, seq):
        trial.not_observable(f"frame {seq} was not released")
    return next(
        connection.arrived(it)
        for it in connection.messages
        if it.type == "release" and (it.value or {}).get("seq") == seq
    )


@check("IMG-12", on={CLIENT: LENDING})
def check_releases_each_frame_of_the_device(trial: ClientTrial) -> None:
    """Frames in device memory are lent one after the other; each must be released once."""
    with ring_of(trial) as (ring, connection):
        released = trial.role.with_(connection).released
        for _ in range(FRAMES):
            _, seq = lend(trial, ring, connection)
            trial.expect(
                trial.releases(connection, seq),
                "not-released",
                f"frame {seq} was not released within 5 s",
            )
        trial.rest(REACTION_SECONDS / 2)
        trial.expect(
            len(released) == FRAMES,
            "released-too-often",
            f"it released {len(released)} of {FRAMES} frames",
        )


@check("IMG-8", on={CLIENT: LENDING})
def check_waits_for_the_event_of_the_slot(trial: ClientTrial) -> None:
    """In every slot the event is pending for a while after the frame is lent; those of the other
    slots are not.
    """
    with ring_of(trial) as (ring, connection):
        for _ in range(trial.role.slots):
            slot = trial.role.coming(connection).slot
            ring.events[slot].begin()
            before = len(trial.calls())
            seq = trial.lend(connection)
            trial.rest(PENDING_SECONDS)
            for call in ring.copies(trial.calls()[before:], slot):
                trial.violated(
                    "read-before-event",
                    f"the event of slot {slot} was pending when it called {call}",
                )
            ring.fill(slot, b"\0")
            ring.events[slot].complete()
            released_at(trial, connection, seq)
            if not ring.copies(trial.calls()[before:], slot):
                trial.not_observable("the testee releases frames, and does not read them")


@check(
    "IMG-13",
    on={CLIENT: LENDING},
)
def check_releases_after_its_copies_have_finished(trial: ClientTrial) -> None:
    """Frames are lent one after the other. Copies that are under way must be seen to finish, by
    the calls that tell the host, before the release arrives.
    """
    with ring_of(trial) as (ring, connection):
        for _ in range(FRAMES):
            slot, seq = lend(trial, ring, connection)
            at = released_at(trial, connection, seq)
            calls = [call for call in trial.calls() if call.time <= at]
            if not ring.copies(calls, slot):
                trial.not_observable("the testee releases frames, and does not read them")
            for call in usage.under_way(calls, ring.memory.name):
                trial.violated(
                    "released-too-early",
                    f"frame {seq} was released before the host saw the end of {call}",
                )


@check("IMG-14", on={CLIENT: LENDING})
def check_reads_no_slot_without_a_lease(trial: ClientTrial) -> None:
    """Frames are lent one after the other, with a pause after each release."""
    with ring_of(trial) as (ring, connection):
        for _ in range(FRAMES // 2):
            before = len(trial.calls())
            slot, seq = lend(trial, ring, connection)
            at = released_at(trial, connection, seq)
            trial.rest(REACTION_SECONDS / 2)
            for other in range(trial.role.slots):
                for call in ring.copies(trial.calls()[before:], other):
                    if other != slot or call.time > at:
                        trial.violated(
                            "read-without-lease",
                            f"without a lease of slot {other} it called {call}",
                        )
