"""Checks on what a client reads of images, and when (spec 1.1 chapter 5, 1.0 chapter 3).

Whatever is not lent is spoilt, and whatever has an event that is pending: a client that reads it
shows it, or is seen to by its calls.
"""

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial

from splatbus_conformance.cases.rings import ORDERS, Arrangement
from splatbus_conformance.checks import (
    CLIENT,
    CLIENT_CALLS,
    CLIENT_DEVICE,
    CLIENT_HOST,
    Place,
    check,
)
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.images.painted import coordinates, sha256, spoilt
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.frame_lender import (
    CHANNELS,
    READS,
    TAKES_FRAMES_ON_DEVICE,
    FrameLender,
    lending,
)
from splatbus_conformance.trials.moves.writers import Writer, odd_spelling, spellings
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import texts, within
from splatbus_conformance.wire.messages import Json, encode

READS_DEVICE = (*TAKES_FRAMES_ON_DEVICE, "adapter:digest")
DEVICE = {CLIENT_DEVICE: READS_DEVICE, CLIENT_CALLS: ("stand-in", *TAKES_FRAMES_ON_DEVICE)}
FOUR_GIB = 1 << 32
SMALL = 1 << 18
"""Pixels of an image that is written and digested in no time."""
LINGER_SECONDS = 0.1
"""A client that reads late has done so after this time, or twice what it takes to read."""
PENDING_SECONDS = 0.2


@check("IMG-8", on=DEVICE, given=lending)
def check_reads_a_frame_after_its_event(trial: ClientTrial, _: Place, lender: FrameLender) -> None:
    """In every slot the event is pending for a while after the frame is lent. Until then the slot
    holds what nobody may show, and the events of all others are complete.
    """
    assert trial.role.ring is not None, "a device has a ring"
    events = trial.role.ring.events
    released = trial.with_(lender.connection).released
    for number in range(2 * trial.role.slots):
        image = coordinates(number, *lender.size)
        seq, slot = lender.announced(image)
        events[slot].begin()
        trial.lend(lender.connection)
        trial.rest(PENDING_SECONDS)
        for call in lender.copies(slot):
            what = f"the event of slot {slot} was pending when it called {call}"
            trial.violated("read-before-event", what)
        told = " and was released" if seq in released else ""
        lender.paint(image, slot)
        events[slot].complete()
        lender.expect_read(seq)
        told = f"was read{told} before the event of slot {slot} was complete"
        lender.expect_intact("read-before-event", told)


@check("IMG-13", on={CLIENT_HOST: READS, **DEVICE}, given=lending)
def check_releases_when_it_has_read(trial: ClientTrial, _: Place, lender: FrameLender) -> None:
    """Images are lent one after the other, as fast as they come back; each slot is written over in
    the moment in which it is released, and the client's image compared with the one that was lent,
    or its copies must be seen to finish, by the calls that tell the host, before that.
    """
    many = trial.thorough and trial.role.width * trial.role.height <= SMALL
    for number in range(400 if many else 30):
        seq = lender.show(coordinates(number, *lender.size))
        lender.expect_intact("released-too-early", "was released before it was read")
        for call in lender.under_way(seq):
            what = f"frame {seq} was released before the host saw the end of {call}"
            trial.violated("released-too-early", what)


@check("IMG-14", on={CLIENT_HOST: READS, **DEVICE}, given=lending)
def check_reads_only_what_it_holds(trial: ClientTrial, _: Place, lender: FrameLender) -> None:
    """After an image was given back, every slot is written over, with images that are not lent and
    with what nobody may show; the client shows the one that it read, or none, and copies nothing.
    """

    def expect_leased(seq: int) -> None:
        for slot, call in lender.without_lease(seq):
            what = f"without a lease of slot {slot} it called {call}"
            trial.violated("read-without-lease", what)

    for number in range(20 if trial.thorough else 3):
        began = time.monotonic()
        seq = lender.lend(coordinates(number, *lender.size))
        trial.releases(lender.connection, seq)
        expect_leased(seq)
        lender.expect_read(seq)
        otherwise = f"was shown after the client had given image {seq} back"
        linger = max(LINGER_SECONDS, 2 * (time.monotonic() - began))
        for slot in range(trial.role.slots):
            lender.paint(coordinates(1000 + number, *lender.size), slot)
        trial.rest(linger)
        lender.expect_intact("read-without-lease", otherwise)
        lender.spoil_everything()
        trial.rest(linger)
        lender.expect_intact("read-without-lease", otherwise)
        expect_leased(seq)


@check(
    "CHN-18",
    on={CLIENT_HOST: (*READS, "returns:ipc"), CLIENT_DEVICE: READS_DEVICE},
    given=lending,
)
def check_leaves_the_buffers_when_the_connection_ends(
    trial: ClientTrial, _: Place, lender: FrameLender
) -> None:
    """The IPC connection ends, while an image is lent and while none is, and every slot is written
    over; the client may keep a picture that it has copied, and shows nothing of what came later.
    """
    for lent in (False, True):
        began = time.monotonic()
        lender.show(coordinates(1 + lent, *lender.size))
        linger = max(LINGER_SECONDS, 2 * (time.monotonic() - began))
        trial.peer.refuse("ipc")
        if lent:
            lender.lend(coordinates(5, *lender.size))
        lender.connection.close()
        trial.rest(REACTION_SECONDS)
        lender.spoil_everything()
        trial.rest(linger)
        lender.expect_intact("read-after-end", "is not what it read while it was connected")
        trial.peer.listen("ipc")
        lender = FrameLender(trial)


@check("INI-10", on={CLIENT: READS})
def check_reads_where_32_bits_do_not_reach(trial: ClientTrial) -> None:
    """Images in a ring whose slots of each channel lie 4 GiB apart: who computes addresses in 32
    bits reads one place for all. A client may decline memory that is so large.
    """
    if sys.platform != "linux":
        trial.not_observable("memory that is mostly holes is to be had on Linux alone")
    role = trial.role
    role.offers_memory, role.slots = False, 2
    role.arrange(Arrangement(ORDERS[2], after=FOUR_GIB - 20 * role.width * role.height))
    with HostMemory(role.host_packet["memory"]["bytes"], sparse=True) as memory:
        role.memory = memory
        connection = trial.for_init_packet()
        role.lends_frames = False
        role.offer(connection)
        trial.require_open(connection)
        lender = FrameLender(trial, connection)
        for number in range(2 * role.slots):
            lender.show(coordinates(number, *lender.size))
            lender.expect_intact("other-place", "was read from another place than its own")


@check(
    "JSN-6",
    on={CLIENT: READS},
)
def check_reads_what_is_lent_in_any_spelling(trial: ClientTrial) -> None:
    """Frames with members in any order, white space, escapes, and numbers in any form: who cannot
    read one gives its slot back all the same. A frame that is spelled plainly is read after each.
    """
    lender, said = FrameLender(trial), [""]

    def listing_none(write: Writer, message: Json) -> bytes:
        said[-1] = write({name: it for name, it in message.items() if name != "objects"}).decode()
        return said[-1].encode()

    trial.role.encode["ipc"] = plainly = partial(listing_none, encode)
    lender.show(coordinates(0, *lender.size))
    for number, case in enumerate(spellings(trial, quick=8, full=200), 1):
        trial.role.encode["ipc"] = partial(listing_none, odd_spelling(case))
        seq = lender.lend(coordinates(number, *lender.size))
        spelt = said[-1]
        given_back = trial.releases(lender.connection, seq)
        trial.role.encode["ipc"] = plainly
        shown = lender.newest()["seq"]
        lender.show(coordinates(0, *lender.size))
        what = f"frame {shorten(spelt)}: its slot was given back, and it was not read"
        trial.expect(not given_back or shown == seq, "not-read", what)


@contextmanager
def subscribing(trial: ClientTrial) -> Iterator[FrameLender]:
    """Checks that follow find the client as this one did: subscribed to both channels."""
    try:
        yield FrameLender(trial)
    finally:
        if not trial.fate():
            trial.ask("subscribe", channels=list(CHANNELS))


@check(
    "IMG-22",
    on={CLIENT: (*READS, "capability:subscribe", "adapter:subscribe")},
    given=subscribing,
)
def check_reads_only_what_it_subscribed_to(trial: ClientTrial, lender: FrameLender) -> None:
    """The client subscribes to one channel and to the other, in turn. A channel that it had not
    subscribed to when it gave the image before back holds what nobody may show; on a new connection
    that goes for what it has subscribed to before it says that it has opened.
    """
    former: Sequence[str] = CHANNELS
    for channel in CHANNELS * 2:
        subscribe(trial, lender, channel)
        shown_of(trial, lender, former)
        former = [channel]
        answer = shown_of(trial, lender, former)
        if answer[channel] is None:
            trial.not_observable(f"subscribed to {channel} alone, the client did not read it")
    if "ipc" not in trial.facts.returns:
        return
    lender = FrameLender(trial)
    heard = trial.with_(lender.connection).heard
    kinds = [message.get("type") for message in heard]
    wishes = [m for m in heard[: kinds.index("opened")] if m.get("type") == "subscribe"]
    shown_of(trial, lender, texts(within(wishes[-1], "channels")) if wishes else CHANNELS)


def subscribe(trial: ClientTrial, lender: FrameLender, channel: str) -> None:
    """Have the client subscribe to one channel alone."""
    dealings = trial.with_(lender.connection)
    before = dealings.count("subscribe")
    trial.ask("subscribe", channels=[channel])
    if not trial.wait(lambda: dealings.count("subscribe") > before):
        trial.not_observable("the client was told to subscribe, and sent no subscribe")


def shown_of(trial: ClientTrial, lender: FrameLender, written: Sequence[str]) -> Json:
    """The client's digest of an image of which these channels alone were written; the requirement
    is violated if it has read others.
    """
    bad = spoilt(*lender.size)._asdict()
    others = {name: image for name, image in bad.items() if name not in written}
    lender.show(coordinates(len(lender.shown), *lender.size)._replace(**others))
    answer = trial.ask("digest")
    for name, image in others.items():
        what = f"it read {name} with {', '.join(written)} subscribed to"
        trial.expect(answer[name] != sha256(image), "read-unsubscribed", what)
    return answer
