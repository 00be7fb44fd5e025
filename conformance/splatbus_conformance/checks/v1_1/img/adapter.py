"""Checks on what a client reads of images, and when (spec 1.1 chapter 5, 1.0 chapter 3).

Whatever is not lent is spoilt: a client that reads it shows it.
"""

import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.cases.rings import ORDERS, Arrangement
from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.images.painted import Painting, coordinates, sha256, spoilt
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.frame_lender import FrameLender
from splatbus_conformance.trials.moves.writers import Writer, odd_spelling, spellings
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import texts, within
from splatbus_conformance.wire.messages import Json, encode

READS = ("hello:ipc", "capability:frames", "opens", "adapter:digest")
CHANNELS = ("color", "depth")
FOUR_GIB = 1 << 32
SMALL = 1 << 18
"""Pixels of an image that is written and digested in no time."""
READINGS: tuple[tuple[str, Callable[[NDArray[Any]], NDArray[Any]]], ...] = (
    ("", lambda image: image),
    (", rows top-down", lambda image: image[::-1]),
    (", blue for red", lambda image: image[..., [2, 1, 0, 3]] if image.ndim == 3 else image),
    (", rounded to 8 bits", lambda image: np.round(np.clip(image, 0, 1) * 255) / np.float32(255)),
    (
        ", opaque",
        lambda image: np.where([0, 0, 0, 1], np.float32(1), image) if image.ndim == 3 else image,
    ),
)
"""Ways in which an image is misread."""
LINGER_SECONDS = 0.1
"""A client that reads late has done so after this time, or twice what it takes to read."""


def parts(answer: Json, image: Painting) -> list[str]:
    """Which of colour and depth, as the client shows them, are not of this image."""
    color, depth = image.digests()
    pairs = (("color", color), ("depth", depth))
    return [name for name, right in pairs if answer[name] not in (None, right)]


def described(answer: Json, names: list[str], lender: FrameLender) -> str:
    """What is known of wrong colour or depth."""
    bad = spoilt(*lender.size)
    for name in names:
        if answer[name] == sha256(getattr(bad, name)):
            return f"its {name} is what the slot held only while nobody was to read it"
        for seq, other in lender.shown.items():
            for words, read in READINGS:
                if answer[name] == sha256(read(getattr(other, name))):
                    return f"its {name} is that of image {seq}{words}"
    return f"its {' and '.join(names)} is of no image whole"


@check(
    "IMG-13",
    observable="digests of what the client read, while a slot is spoilt as soon as it is released",
    on={CLIENT: READS},
)
def check_releases_when_it_has_read(trial: ClientTrial) -> None:
    """Images are lent one after the other, as fast as they come back; each slot is written over in
    the moment in which it is released, and the client's image compared with the one that was lent.
    """
    lender = FrameLender(trial)
    many = trial.thorough and trial.role.width * trial.role.height <= SMALL
    for number in range(400 if many else 30):
        lender.show(coordinates(number, *lender.size))
        _judge(trial, lender, "released-too-early", "was released before it was read")


@check("INI-10", observable="digests of images that lie 4 GiB apart", on={CLIENT: READS})
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
        role.offer(connection, role.init_packet(connection))
        trial.require_open(connection)
        lender = FrameLender(trial, connection)
        for number in range(2 * role.slots):
            lender.show(coordinates(number, *lender.size))
            _judge(trial, lender, "other-place", "was read from another place than its own")


@check(
    "IMG-14",
    observable="digests of what the client shows, while every slot changes and none is lent",
    on={CLIENT: READS},
)
def check_reads_only_what_it_holds(trial: ClientTrial) -> None:
    """After an image was given back, every slot is written over, with images that are not lent and
    with what nobody may show; the client shows the one that it read, or none.
    """
    lender = FrameLender(trial)
    for number in range(20 if trial.thorough else 3):
        began = time.monotonic()
        seq = lender.show(coordinates(number, *lender.size))
        otherwise = f"was shown after the client had given image {seq} back"
        linger = max(LINGER_SECONDS, 2 * (time.monotonic() - began))
        for slot in range(trial.role.slots):
            lender.paint(coordinates(1000 + number, *lender.size), slot)
        trial.rest(linger)
        _judge(trial, lender, "read-without-lease", otherwise)
        lender.spoil_everything()
        trial.rest(linger)
        _judge(trial, lender, "read-without-lease", otherwise)


@check(
    "JSN-6",
    observable="the client's newest image is the one whose frame was spelled so",
    on={CLIENT: READS},
)
def check_reads_what_is_lent_in_any_spelling(trial: ClientTrial) -> None:
    """Frames with members in any order, white space, escapes, and numbers in any form: who cannot
    read one gives its slot back all the same. A frame that is spelled plainly is read after each.
    """
    lender = FrameLender(trial)

    def listing_none(message: Json) -> Json:
        return {name: it for name, it in message.items() if name != "objects"}

    def plainly(message: Json) -> bytes:
        return encode(listing_none(message))

    def oddly(write: Writer, message: Json) -> bytes:
        said.append(write(listing_none(message)).decode())
        return said[-1].encode()

    said: list[str] = []
    trial.role.encode["ipc"] = plainly
    lender.show(coordinates(0, *lender.size))
    for number, case in enumerate(spellings(trial, quick=8, full=200), 1):
        spelt = len(said)
        trial.role.encode["ipc"] = partial(oddly, odd_spelling(case))
        seq = lender.lend(coordinates(number, *lender.size))
        given_back = trial.releases(lender.connection, seq)
        trial.role.encode["ipc"] = plainly
        shown = lender.newest()["seq"]
        lender.show(coordinates(0, *lender.size))
        what = f"frame {shorten(said[spelt])}: its slot was given back, and it was not read"
        trial.expect(not given_back or shown == seq, "not-read", what)
        trial.delivered += 1


def _judge(trial: ClientTrial, lender: FrameLender, code: str, otherwise: str) -> None:
    answer = trial.ask("digest")
    if answer["seq"] is None:
        return
    if answer["seq"] not in lender.shown:
        trial.violated(
            "never-lent", f"the client shows image {answer['seq']}, which was never lent"
        )
    if wrong := parts(answer, lender.shown[answer["seq"]]):
        trial.violated(
            code, f"image {answer['seq']} {otherwise}: {described(answer, wrong, lender)}"
        )
    trial.delivered += 1


@check(
    "IMG-22",
    observable="the channel that was not subscribed to, which holds what nobody may show",
    on={CLIENT: (*READS, "capability:subscribe", "adapter:subscribe")},
)
def check_reads_only_what_it_subscribed_to(trial: ClientTrial) -> None:
    """The client subscribes to one channel and to the other, in turn. A channel that it had not
    subscribed to when it gave the image before back holds what nobody may show.
    """
    try:
        _judge_subscriptions(trial, FrameLender(trial))
    finally:
        if not trial.fate():  # checks that follow find it as this one did
            trial.ask("subscribe", channels=list(CHANNELS))


def _judge_subscriptions(trial: ClientTrial, lender: FrameLender) -> None:
    bad = spoilt(*lender.size)._asdict()
    written = set(CHANNELS)
    for number, channel in enumerate(CHANNELS * 2):
        _subscribe(trial, lender, [channel])
        for step in range(2):
            image = coordinates(2 * number + step, *lender.size)
            lender.show(image._replace(**{n: bad[n] for n in bad.keys() - written}))
            answer = trial.ask("digest")
            for name in bad.keys() - written:
                if answer[name] == sha256(bad[name]):
                    trial.violated(
                        "read-unsubscribed",
                        f"it read {name} with {', '.join(written)} subscribed to",
                    )
            written = {channel}
        if answer[channel] is None:
            trial.not_observable(f"subscribed to {channel} alone, the client did not read it")
        trial.delivered += 1
    _judge_what_is_subscribed_again(trial)


def _judge_what_is_subscribed_again(trial: ClientTrial) -> None:
    """On a new connection, what it has subscribed to before it says that it has opened."""
    if "ipc" not in trial.facts.returns:
        return
    lender = FrameLender(trial)
    heard = trial.role.with_(lender.connection).heard
    kinds = [message.get("type") for message in heard]
    wishes = [m for m in heard[: kinds.index("opened")] if m.get("type") == "subscribe"]
    wanted = texts(within(wishes[-1], "channels")) if wishes else CHANNELS
    bad = spoilt(*lender.size)._asdict()
    unwritten = [name for name in CHANNELS if name not in wanted]
    lender.show(coordinates(0, *lender.size)._replace(**{n: bad[n] for n in unwritten}))
    answer = trial.ask("digest")
    for name in unwritten:
        if answer[name] == sha256(bad[name]):
            trial.violated(
                "read-unsubscribed",
                f"on a new connection it read {name} with {wanted} subscribed to",
            )


def _subscribe(trial: ClientTrial, lender: FrameLender, channels: list[str]) -> None:
    dealings = trial.role.with_(lender.connection)
    before = dealings.count("subscribe")
    trial.ask("subscribe", channels=channels)
    if not trial.wait(lambda: dealings.count("subscribe") > before):
        trial.not_observable("the client was told to subscribe, and sent no subscribe")


@check(
    "CHN-18",
    observable="digests of what the client shows after the connection ended and the memory changed",
    on={CLIENT: (*READS, "returns:ipc")},
)
def check_leaves_the_buffers_when_the_connection_ends(trial: ClientTrial) -> None:
    """The IPC connection ends, while an image is lent and while none is, and every slot is written
    over; the client may keep a picture that it has copied, and shows nothing of what came later.
    """
    lender = FrameLender(trial)
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
        _judge(
            trial, lender, "read-after-end", "is not what the client read while it was connected"
        )
        trial.peer.listen("ipc")
        lender = FrameLender(trial)
