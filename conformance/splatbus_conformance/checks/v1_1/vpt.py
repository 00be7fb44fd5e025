"""Checks on images of another size, which a client asked for (spec 1.1 chapter 8)."""

import time
from functools import partial
from itertools import count
from typing import Any

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import CLIENT, SERVER, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.controls import CAMERA_REQUEST, VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.control import controlling
from splatbus_conformance.trials.moves.image_session import answers, further
from splatbus_conformance.trials.moves.listening import listen
from splatbus_conformance.trials.moves.resizing import (
    REINIT_SECONDS,
    RESIZES,
    Size,
    asked,
    asked_again,
    changed,
    drawn_sizes,
    other_sizes,
    readers,
    resizing,
    size_of,
    wait_until_told,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.conversation import Message
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import Json, camera_pose, error
from splatbus_conformance.wire.sockets import Connection

_ids = count(1)
PAUSE: float = LIMITS["ask_again_min_seconds"]
LARGEST: int = LIMITS["max_image_size"]
BAD_SIZES: tuple[tuple[Any, Any], ...] = (
    *((0, 0), (-1, 48), (64, LARGEST + 1), (1.5, 48), ("64", "48"), (None, 48), (2**31, 2**31)),
)


@check("VPT-2", on={SERVER: ("1.1", "capability:viewport")}, given=resizing)
def check_answers_with_the_size_or_an_error(trial: ServerTrial, client: Connection) -> None:
    """Sizes that are none, and several that are, with nobody who reads images; the size that is
    told from then on is the one that was agreed, and an error leaves it as it was.
    """
    in_force = list(trial.facts.size)
    listed = [*BAD_SIZES, *other_sizes(trial)]
    for size in trial.each(listed, drawn_sizes(trial), quick=4, full=200):
        reply = asked(trial, client, size)
        kind, what = reply.get("type"), f"set_viewport to {show(size[0])}×{show(size[1])}"
        agreed = kind == "viewport_size" and reply.get("viewport_size") == list(size)
        told = f"{what} was answered by {show(reply)}"
        trial.expect(kind == "error" or agreed, "another-answer", told)
        trial.expect(kind == "error" or size not in BAD_SIZES, "accepts", f"{what} was agreed to")
        in_force = list(size) if agreed else in_force
        now = (trial.ask(client, VIEWPORT_REQUEST) or {}).get("viewport_size")
        done = "agreed to" if agreed else "refused"
        trial.expect(
            now in (in_force, [0, 0]),
            "wrong-size" if agreed else "refused-yet-changed",
            f"{what} was {done}, and then the size is told as {show(now)}",
        )


@check("NEG-29", on={SERVER: ("1.1", "capability:viewport")}, given=resizing)
def check_answers_what_follows_another_size_after_it(
    trial: ServerTrial, client: Connection
) -> bool:
    """A `set_viewport` that changes the size, and other requests right behind it."""
    agreed = 0

    def agrees(size: Size) -> bool:
        """Whether images have this size now."""
        sized = {"type": "set_viewport", "width": size[0], "height": size[1]}
        behind = (CAMERA_REQUEST, VIEWPORT_REQUEST, sized, {"type": "ping", "t": 12.5})
        requests = [it | {"id": next(_ids)} for it in (sized, *behind, {"type": "get_scene"})]
        heard = trial.ask_all(client, requests)
        ids, wanted = [it["id"] for it in heard if "id" in it], [it["id"] for it in requests]
        what = f"set_viewport to {size[0]}×{size[1]} and requests behind it have the ids"
        told = f"{what} {show(wanted)}, and their answers {show(ids)}"
        trial.expect(ids == wanted, "out-of-order", told)
        return heard[0].get("type") == "viewport_size"

    for size in trial.each(other_sizes(trial)):
        if not trial.peer.until(partial(agrees, size), EFFECT_SECONDS):
            break
        agreed += 1
    return agreed > 0


@check("VPT-3", on={SERVER: RESIZES}, given=resizing)
def check_changes_nothing_for_who_cannot_follow(trial: ServerTrial, client: Connection) -> None:
    """Two readers, of which one does not list `reinit`; it leaves, and then comes back. Alone, the
    other one lets the size change.
    """
    reader = trial.reading()
    changed(trial, client, other_sizes(trial)[2], reader)
    packets = trial.with_(reader).init_packets
    for size in trial.each(other_sizes(trial)[:2]):
        had = len(packets)
        offer = [it for it in trial.viewer.capabilities["ipc"] if it != "reinit"]
        stiff = trial.ready("ipc", capabilities=offer)
        if reader.ended or not trial.with_(stiff).init_packets:
            trial.not_observable("the server announces its memory to one reader at a time")
        code = asked_again(trial, client, size, "busy")
        told = f"set_viewport beside a reader without reinit was answered by {code}"
        trial.expect(code == "unsupported", "another-answer", told)
        trial.rest(REACTION_SECONDS / 2)
        told = "and then the other reader was sent an init packet"
        trial.expect(len(packets) == had, "unwanted-init-packet", told)
        stiff.close()
        code = asked_again(trial, client, size, "busy", "unsupported")
        told = f"once the reader without reinit had gone, set_viewport was answered by {code}"
        trial.expect(code == "viewport_size", "still-refused", told)
        wait_until_told(trial, size, reader)


def expect_busy(trial: ServerTrial, client: Connection, size: Size, when: str) -> None:
    """Another size is refused, for now."""
    code = asked_again(trial, client, size)
    trial.expect(code == "busy", "another-answer", f"{when} was answered by {code}")


@check("VPT-4", on={SERVER: RESIZES}, given=resizing)
def check_obeys_who_has_control(trial: ServerTrial, client: Connection) -> None:
    """One client poses the camera; another asks for a size, before and after it has posed too, then
    the first, then the other once the first has gone.
    """
    first = controlling(trial)
    if client.ended:
        trial.not_observable("the server serves one message connection at a time")
    one, two, three, _ = other_sizes(trial)
    for what in ("without control", "that waits for control"):
        expect_busy(trial, client, one, f"a client {what}")
        trial.viewer.say(client, camera_pose())
        answers(trial, client)
    changed(trial, first, two)
    first.close()
    changed(trial, client, three)


@check("VPT-4", on={SERVER: RESIZES}, given=resizing)
def check_has_memory_twice_at_most(trial: ServerTrial, client: Connection) -> None:
    """A reader opens memory of another size and keeps what it had; a third size is asked for."""
    reader = trial.reading()
    dealings = trial.with_(reader)
    dealings.keeps = True
    one, two, *_ = other_sizes(trial)
    changed(trial, client, one)
    trial.wait(lambda: dealings.kept or reader.ended, REINIT_SECONDS)
    expect_busy(trial, client, two, "set_viewport, while former memory is in use,")
    trial.viewer.let_go(reader)
    changed(trial, client, two)


@check("VPT-10", on={SERVER: RESIZES}, given=resizing)
def check_is_not_busy_for_ever(trial: ServerTrial, _: Connection) -> None:
    """The size changes again and again, while nobody reads, and beside a reader that lets go of
    what was before.
    """
    client, beside = controlling(trial), list[Connection]()
    sizes = [*other_sizes(trial)[:2], trial.facts.size]
    for number, size in enumerate(trial.each(sizes * 2)):
        if number == len(sizes):
            beside.append(trial.reading())
        code = asked_again(trial, client, size, "busy")
        code = asked_again(trial, client, size, "busy") if code == "busy" else code
        if code != "busy" or trial.testee.expendable:  # else others may be there, who read
            what = f"set_viewport to {size[0]}×{size[1]} was answered by busy"
            trial.expect(code != "busy", "busy-for-ever", f"{what} for {2 * EFFECT_SECONDS} s")
        if code != "viewport_size":
            trial.not_observable(f"the server has no images of {size[0]}×{size[1]}: {code}")
        wait_until_told(trial, size, *beside)


@check("VPT-5", on={SERVER: RESIZES}, given=resizing)
def check_tells_every_reader_of_another_size(trial: ServerTrial, client: Connection) -> None:
    """Up to three readers, of which one holds a frame, and one takes none; the size changes again
    and again.
    """
    everyone = readers(trial, 2)
    trial.with_(everyone[0]).holds = True
    everyone.append(trial.ready("ipc", capabilities=["host_shm", "cuda_ipc", "reinit"]))
    everyone = [it for it in everyone if not it.ended]  # older ones may be closed (CHN-13)
    former = trial.facts.size
    # The last three change the width alone, and the height alone.
    sizes = [*other_sizes(trial), (1, former[1]), former, (former[0], former[1] + 1)]
    for size in trial.each(sizes, drawn_sizes(trial), quick=2, full=50):
        if size == former:
            continue
        former = size
        told = {it: trial.with_(it).init_packets for it in everyone}
        due = {it: len(packets) for it, packets in told.items() if packets}
        changed(trial, client, size, *due)
        for number, (it, had) in enumerate(due.items(), 1):
            what = f"reader {number} of {len(due)}, when the size was set to {size}"
            came = len(told[it]) > had
            trial.expect(came, "no-init-packet", f"{what}: no init packet within 5 s")
            now = size_of(told[it][-1])
            why = f"{what}: its init packet is for {now[0]}×{now[1]}"
            trial.expect(now == size, "wrong-size", why)


@check("VPT-6", on={SERVER: RESIZES}, given=resizing)
def check_announces_no_other_memory_unasked(trial: ServerTrial, client: Connection) -> None:
    """The size that images have, again and again, also once they have another; sizes that are none;
    a size while another client has control. An init packet comes of none of these.
    """
    reader = trial.reading()
    packets = trial.with_(reader).init_packets
    size, others = trial.facts.size, other_sizes(trial)
    for another in (others[2], others[0]):
        had = len(packets)
        for asks in trial.each([*[size] * 3, *BAD_SIZES, size]):
            asked(trial, client, asks)
        granted = asked_again(trial, client, another, "busy") == "viewport_size"
        if granted:
            wait_until_told(trial, another, reader)
        else:
            trial.rest(REACTION_SECONDS)
        came = [it for it in packets[had:] if not (granted and size_of(it) == another)]
        told = f"{len(came)} further init packets came, of a size that images have or of requests"
        trial.expect(not came, "unwanted-init-packet", f"{told} that were answered by errors")
        if not granted:
            break
        size = another
    had = len(packets)
    first = further(trial, client)
    trial.viewer.say(first, camera_pose())
    answers(trial, first)
    refused = asked_again(trial, client, others[1]) != "viewport_size"
    trial.rest(REACTION_SECONDS)
    came = packets[had:]
    told = f"{len(came)} further init packets came of a request that was answered by an error"
    trial.expect(not (came and refused), "unwanted-init-packet", told)
    trial.expect(not reader.ended, "closes", "the reader's connection was closed")
    first.close()


@check("VPT-9", on={CLIENT: ("hello:msg", "says:set_viewport", "returns:msg")})
def check_asks_for_a_size_again_later(trial: ClientTrial) -> None:
    """Whoever asks for another size, is told `busy`, once all has come that it asks ahead."""
    waiting: list[Json] = []
    former = trial.peer.on_message

    def on_message(connection: Connection, message: Message) -> None:
        if message.value is None or message.type != "set_viewport":
            former(connection, message)
            return
        waiting.append(message.value)
        again.append(connection.arrived(message))

    again: list[float] = []
    trial.peer.on_message = on_message
    connection = trial.greeted("msg")
    if not trial.grows(connection, waiting):
        trial.not_observable("the testee did not ask for another size again")
    listen(trial, connection)
    again.clear()
    told = time.monotonic()
    for request in waiting:
        members = {"id": request["id"]} if "id" in request else {}
        trial.role.say(connection, error("busy", **members))
    trial.grows(connection, again, 0, 10 * PAUSE)
    pause = again[0] - told if again else PAUSE
    what = f"it asked again {1000 * pause:.0f} ms after it was told busy"
    trial.expect(pause >= PAUSE, "too-soon", what)
