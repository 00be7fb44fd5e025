"""Checks on images of another size, which a client asked for (spec 1.1 chapter 8)."""

from functools import partial
from itertools import count
from typing import Any

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.trials.controls import CAMERA_REQUEST, VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.control import controlling
from splatbus_conformance.trials.moves.image_session import answers, further
from splatbus_conformance.trials.moves.resizing import (
    REINIT_SECONDS,
    RESIZES,
    Size,
    asked,
    asked_again,
    changed,
    dealings_of,
    drawn_sizes,
    other_sizes,
    readers,
    resizing,
    size_of,
    wait_until_told,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import Json, camera_pose
from splatbus_conformance.wire.sockets import Connection

_firsts = count(1, 6)
LARGEST: int = LIMITS["max_image_size"]
BAD_SIZES: tuple[tuple[Any, Any], ...] = (
    *((0, 0), (-1, 48), (64, LARGEST + 1), (1.5, 48), ("64", "48"), (None, 48), (2**31, 2**31)),
)


@check("VPT-2", observable="the reply, or the error", on={SERVER: ("1.1", "capability:viewport")})
def check_answers_with_the_size_or_an_error(trial: ServerTrial) -> None:
    """Sizes that are none, and several that are, with nobody who reads images; the size that is
    told from then on is the one that was agreed, and an error leaves it as it was.
    """
    with resizing(trial) as client:
        in_force = list(trial.facts.size)
        listed = [*BAD_SIZES, *other_sizes(trial)]
        for size in trial.each(listed, drawn_sizes(trial), quick=4, full=200):
            reply = asked(trial, client, size)
            kind, what = reply.get("type"), f"set_viewport to {show(size[0])}×{show(size[1])}"
            agreed = kind == "viewport_size" and reply.get("viewport_size") == list(size)
            trial.expect(
                kind == "error" or agreed, "another-answer", f"{what} was answered by {show(reply)}"
            )
            trial.expect(
                kind == "error" or size not in BAD_SIZES, "accepts", f"{what} was agreed to"
            )
            in_force = list(size) if agreed else in_force
            now = trial.ask(client, VIEWPORT_REQUEST) or {}
            told_now = now.get("viewport_size")
            trial.expect(
                told_now in (in_force, [0, 0]),
                "wrong-size" if agreed else "refused-yet-changed",
                f"{what} was {'agreed to' if agreed else 'refused'}, and then the size is told as"
                f" {show(told_now)}",
            )
            trial.delivered += 1
        another, _ = trial.answered("msg")
        size_now = (trial.ask(another, VIEWPORT_REQUEST) or {}).get("viewport_size")
        trial.expect(
            # Once nobody is there who asked for it, a server may go back to its own size.
            size_now in (in_force, [0, 0]) or client.ended or another.ended,
            "size-forgotten",
            f"the size was set to {in_force}, and a client that comes is told {show(size_now)}",
        )


@check("NEG-29", observable="the order of the answers", on={SERVER: ("1.1", "capability:viewport")})
def check_answers_what_follows_another_size_after_it(trial: ServerTrial) -> None:
    """A `set_viewport` that changes the size, and other requests right behind it."""
    with resizing(trial) as client:
        for size in trial.each(other_sizes(trial)):
            agreed = partial(_agreed_in_order, trial, client, size)
            if not trial.peer.until(agreed, EFFECT_SECONDS):
                break
            trial.delivered += 1


def _agreed_in_order(trial: ServerTrial, client: Connection, size: Size) -> bool:
    """Whether images have this size now; what is asked right behind has to be answered later."""
    first = next(_firsts)
    requests: tuple[Json, ...] = (
        {"type": "set_viewport", "width": size[0], "height": size[1]},
        CAMERA_REQUEST,
        VIEWPORT_REQUEST,
        {"type": "set_viewport", "width": size[0], "height": size[1]},
        {"type": "ping", "t": 12.5},
        {"type": "get_scene"},
    )
    asked = [request | {"id": first + place} for place, request in enumerate(requests)]
    heard = trial.ask_all(client, asked)
    ids = [answer.get("id") for answer in heard if "id" in answer]
    last = first + len(asked) - 1
    what = f"set_viewport to {size[0]}×{size[1]} and requests behind it have the ids {first} to"
    trial.expect(
        ids == [request["id"] for request in asked],
        "out-of-order",
        f"{what} {last}, and their answers {show(ids)}",
    )
    return any(answer.get("type") == "viewport_size" for answer in heard[:1])


@check("VPT-3", observable="the error while one reader takes no reinit", on={SERVER: RESIZES})
def check_changes_nothing_for_who_cannot_follow(trial: ServerTrial) -> None:
    """Two readers, of which one does not list `reinit`; it leaves, and then comes back. Alone, the
    other one lets the size change.
    """
    with resizing(trial) as client:
        reader = trial.reading()
        changed(trial, client, other_sizes(trial)[2], reader)
        packets = dealings_of(trial, reader).init_packets
        for size in trial.each(other_sizes(trial)[:2]):
            had = len(packets)
            offer = [it for it in trial.viewer.capabilities["ipc"] if it != "reinit"]
            stiff = trial.ready("ipc", capabilities=offer)
            if reader.ended or not dealings_of(trial, stiff).init_packets:
                trial.not_observable("the server announces its memory to one reader at a time")
            code = asked_again(trial, client, size, "busy")
            trial.expect(
                code == "unsupported",
                "another-answer",
                f"set_viewport beside a reader without reinit was answered by {show(code)}",
            )
            trial.rest(REACTION_SECONDS / 2)
            trial.expect(
                len(packets) == had,
                "unwanted-init-packet",
                "and then the other reader was sent an init packet",
            )
            stiff.close()
            code = asked_again(trial, client, size, "busy", "unsupported")
            trial.expect(
                code == "viewport_size",
                "still-refused",
                f"once the reader without reinit had gone, set_viewport was answered by {code}",
            )
            wait_until_told(trial, size, reader)
            trial.delivered += 1


def _code(answer: Json) -> Any:
    return answer.get("code") or answer.get("type")


@check("VPT-4", observable="the error while another client has control", on={SERVER: RESIZES})
def check_obeys_who_has_control(trial: ServerTrial) -> None:
    """One client poses the camera; another asks for a size, before and after it has posed too, then
    the first, then the other once the first has gone.
    """
    with resizing(trial) as client:
        first = controlling(trial)
        if client.ended:
            trial.not_observable("the server serves one message connection at a time")
        one, two, three, _ = other_sizes(trial)
        for what in ("without control", "that waits for control"):
            code = _code(asked(trial, client, one))
            trial.expect(
                code == "busy", "another-answer", f"a client {what} was answered by {show(code)}"
            )
            trial.viewer.say(client, camera_pose())
            answers(trial, client)
        changed(trial, first, two)
        first.close()
        changed(trial, client, three)
        trial.delivered += 3


@check("VPT-4", observable="the error while former memory is in use", on={SERVER: RESIZES})
def check_has_memory_twice_at_most(trial: ServerTrial) -> None:
    """A reader opens memory of another size and keeps what it had; a third size is asked for."""
    with resizing(trial) as client:
        reader = trial.reading()
        dealings = dealings_of(trial, reader)
        dealings.keeps = True
        one, two, *_ = other_sizes(trial)
        changed(trial, client, one)
        trial.wait(lambda: dealings.kept or reader.ended, REINIT_SECONDS)
        code = _code(asked(trial, client, two))
        trial.expect(
            code == "busy",
            "another-answer",
            f"while former memory is in use the answer is {show(code)}",
        )
        trial.viewer.let_go(reader)
        changed(trial, client, two)
        trial.delivered += 1


@check("VPT-10", observable="the answers to the client that has control", on={SERVER: RESIZES})
def check_is_not_busy_for_ever(trial: ServerTrial) -> None:
    """The size changes again and again, while nobody reads, and beside a reader that lets go of
    what was before.
    """
    with resizing(trial):
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
            trial.delivered += 1


@check("VPT-5", observable="the init packets of all readers", on={SERVER: RESIZES})
def check_tells_every_reader_of_another_size(trial: ServerTrial) -> None:
    """Up to three readers, of which one holds a frame, and one takes none; the size changes again
    and again.
    """
    with resizing(trial) as client:
        everyone = readers(trial, 2)
        dealings_of(trial, everyone[0]).holds = True
        everyone.append(trial.ready("ipc", capabilities=["host_shm", "cuda_ipc", "reinit"]))
        everyone = [it for it in everyone if not it.ended]  # older ones may be closed (CHN-13)
        former = trial.facts.size
        # The last three change the width alone, and the height alone.
        sizes = [*other_sizes(trial), (1, former[1]), former, (former[0], former[1] + 1)]
        for size in trial.each(sizes, drawn_sizes(trial), quick=2, full=50):
            if size == former:
                continue
            former = size
            had = {it: len(dealings_of(trial, it).init_packets) for it in everyone}
            due = {it: dealings_of(trial, it).init_packets for it in everyone if had[it]}
            changed(trial, client, size, *due)
            for number, (it, packets) in enumerate(due.items(), 1):
                what = f"reader {number} of {len(due)}, when the size was set to {size}"
                trial.expect(not it.ended, "closes", f"{what}: its connection was closed")
                trial.expect(
                    len(packets) > had[it], "no-init-packet", f"{what}: no init packet within 5 s"
                )
                now = size_of(packets[-1])
                trial.expect(
                    now == size, "wrong-size", f"{what}: its init packet is for {now[0]}×{now[1]}"
                )
            trial.delivered += 1


@check("VPT-6", observable="that no init packet comes", on={SERVER: RESIZES})
def check_announces_no_other_memory_unasked(trial: ServerTrial) -> None:
    """The size that images have, again and again, also once they have another; sizes that are none;
    a size while another client has control.
    """
    with resizing(trial) as client:
        reader = trial.reading()
        packets = dealings_of(trial, reader).init_packets
        size, others = trial.facts.size, other_sizes(trial)
        for another in (others[2], others[0]):
            had = len(packets)
            for asks in trial.each([*[size] * 3, *BAD_SIZES, size]):
                asked(trial, client, asks)
                trial.delivered += 1
            if not _only_of(trial, client, reader, another, had):
                break
            size = another
        had = len(packets)
        first = further(trial, client)
        trial.viewer.say(first, camera_pose())
        answers(trial, first)
        refused = asked(trial, client, other_sizes(trial)[1]).get("type") == "error"
        trial.rest(REACTION_SECONDS)
        trial.expect(
            len(packets) == had or not refused,
            "unwanted-init-packet",
            f"{len(packets) - had} further init packets came of a request that was answered by an"
            " error",
        )
        trial.expect(not reader.ended, "closes", "the reader's connection was closed")
        first.close()


def _only_of(
    trial: ServerTrial, client: Connection, reader: Connection, another: Size, had: int
) -> bool:
    """Expect that before the init packet of a size that is asked for now no further one has come;
    whether the size was granted.
    """
    packets = dealings_of(trial, reader).init_packets
    granted = asked_again(trial, client, another, "busy") == "viewport_size"
    if granted:
        trial.wait(lambda: size_of(packets[-1]) == another or reader.ended, REINIT_SECONDS)
        came = [it for it in packets[had:] if size_of(it) != another]
    else:
        trial.rest(REACTION_SECONDS)
        came = packets[had:]
    trial.expect(
        not came,
        "unwanted-init-packet",
        f"{len(came)} further init packets came, of a size that images have or of requests that"
        " were answered by errors",
    )
    return granted
