"""Images of another size: asks for them, and puts things back (spec 1.1 chapter 8)."""

import contextlib
import itertools
import math
import random
from collections.abc import Iterator
from typing import Any, NamedTuple

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.trials.moves.frame_capture import FrameCapture
from splatbus_conformance.trials.moves.frame_readers import joined
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.json_values import whole, within
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

RESIZES = ("1.1", "frames", "capability:viewport", "capability:reinit")
"""What a server must have shown whose images may have another size."""
MOST_ID: int = LIMITS["max_safe_integer"]
REINIT_SECONDS: float = LIMITS["reinit_seconds"]
Size = tuple[int, int]
_ids = map(random.Random(0).randrange, itertools.repeat(MOST_ID + 1))


def other_sizes(trial: ServerTrial) -> list[Size]:
    """Sizes that images do not have, none of them large."""
    width, height = trial.facts.size
    return [
        (max(1, width // 2), max(1, height // 2)),
        (width + 3, height + 5),
        (max(1, height // 2), max(1, width // 2) + 1),
        (1, 1),
    ]


def drawn_sizes(trial: ServerTrial) -> st.SearchStrategy[Size]:
    """Sizes of every shape, up to three times as wide and high as images are."""
    width, height = trial.facts.size
    return st.tuples(st.integers(1, 3 * width), st.integers(1, 3 * height))


def asked(trial: ServerTrial, client: Connection, size: tuple[Any, Any]) -> Json:
    """The answer to `set_viewport`; the requirement is violated without one."""
    id = next(_ids)
    request: Json = {"type": "set_viewport", "width": size[0], "height": size[1], "id": id}
    heard = trial.with_(client).heard
    before = len(heard)
    trial.viewer.say(client, request)

    def answer() -> Json | None:
        return next((it for it in heard[before:] if it.get("id") == id), None)

    trial.wait(lambda: answer() or client.ended)
    reply = answer()
    if reply is None:
        trial.violated(
            "no-reply", f"set_viewport to {size[0]}×{size[1]} was not answered with its id"
        )
    return reply


def asked_again(trial: ServerTrial, client: Connection, size: Size, *passing: str) -> str:
    """What `set_viewport` is answered by, the code of an error or a type, once it is no more one of
    these that may pass: a server may not have noticed that readers have gone, or let go.
    """
    said: list[str] = []

    def done() -> bool:
        answer = asked(trial, client, size)
        said.append(str(answer.get("code") or answer.get("type")))
        if said[-1] in passing:
            trial.rest(REACTION_SECONDS / 4)
        return said[-1] not in passing

    trial.peer.until(done, EFFECT_SECONDS)
    return said[-1]


def changed(trial: ServerTrial, client: Connection, size: Size, *readers: Connection) -> None:
    """Have images of another size, of which these readers are to be told; skips the check where the
    server has none of that size.
    """
    answer = asked_again(trial, client, size, "busy")
    if answer != "viewport_size":
        trial.not_observable(f"set_viewport to {size[0]}×{size[1]} was answered by {answer}")
    wait_until_told(trial, size, *readers)


def wait_until_told(trial: ServerTrial, size: Size, *readers: Connection) -> None:
    """Wait until these readers have been told of the size that images have."""
    newest = [trial.with_(reader).init_packets for reader in readers]
    trial.wait(lambda: all(size_of(it[-1]) == size for it in newest), REINIT_SECONDS)


@contextlib.contextmanager
def resizing(trial: ServerTrial) -> Iterator[Connection]:
    """A client for `set_viewport`, from which `move` poses the camera too; afterwards images have
    the size that they had before.
    """
    if trial.facts.size == (0, 0):
        trial.not_observable("the server announced no size")
    try:
        yield trial.commanding()
    finally:
        trial.viewer.opens = trial.viewer.releases = True
        trial.peer.close_all()
        _restore(trial)


class Sitting(NamedTuple):
    """A client that changes the size, and one that reads frames."""

    client: Connection
    capture: FrameCapture


@contextlib.contextmanager
def sitting(trial: ServerTrial) -> Iterator[Sitting]:
    """Both connected; afterwards images have the size that they had before."""
    with resizing(trial) as client:
        yield Sitting(client, FrameCapture(trial))


def _restore(trial: ServerTrial) -> None:
    """Whatever the check found, those that follow rely on the size that they know."""
    client = trial.greeted("msg")
    width, height = trial.facts.size
    request: Json = {"type": "set_viewport", "width": width, "height": height}

    def restored() -> bool:
        return (trial.ask(client, request) or {}).get("type") == "viewport_size"

    trial.wait(lambda: client.ended or restored())
    if not restored() and trial.testee.expendable:
        trial.testee.stop()


def told_at(reader: Connection) -> float:
    """When the newest init packet came, by the monotonic clock: a reader may keep former memory for
    a while from then on (VPT-8).
    """
    newest = reversed(reader.messages)
    return next((reader.arrived(it) for it in newest if "meta" in (it.value or {})), math.inf)


def size_of(init_packet: Json) -> tuple[int | None, int | None]:
    """The width and height that an init packet tells."""
    return whole(within(init_packet, "meta", "w"), 1), whole(within(init_packet, "meta", "h"), 1)


def readers(trial: ServerTrial, most: int = 3) -> list[Connection]:
    """As many readers as the server serves, up to so many; it may close older ones for a further
    one (CHN-13).
    """
    found = [trial.reading()]
    while len(found) < most and (further := joined(trial)):
        found.append(further)
        if any(reader.ended for reader in found):
            break
    return [reader for reader in found if not reader.ended]
