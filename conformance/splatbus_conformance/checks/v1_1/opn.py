"""Checks on opening memory, failing to, and letting it go: OPN, and VPT-7 and VPT-8, which say for
how long a server keeps what it has replaced (spec 1.1 chapters 4 and 8).
"""

import os
import struct
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.handles import UNKNOWN_HANDLE
from splatbus_conformance.cases.malformed.init_packets import ABSENT, ROOM, changed
from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.cases.valid.init_packets import SEMANTICS, layouts
from splatbus_conformance.checks import (
    CLIENT,
    DECLARES_HOST_MEMORY,
    OPENS_HOST_MEMORY,
    SERVER,
    SERVER_DEVICE,
    SERVER_HOST,
    Cases,
    Place,
    check,
)
from splatbus_conformance.images.memory.cuda_stand_in.ring import DeviceRing
from splatbus_conformance.images.memory.device import STAND_IN
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.images.memory.reading import LINUX_FOLDER, Opened
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves import resizing
from splatbus_conformance.trials.moves.announced import announced, expect_kept
from splatbus_conformance.trials.moves.frame_lender import OPENS_DEVICE, ring_on_device
from splatbus_conformance.trials.moves.frame_readers import (
    LENDS,
    answer_and_leave,
    beside,
    contents,
    holding,
    memory_of,
)
from splatbus_conformance.trials.moves.memory_offers import NOWHERE, announce, outcome_of
from splatbus_conformance.trials.moves.resizing import (
    REINIT_SECONDS,
    RESIZES,
    Size,
    other_sizes,
    told_at,
)
from splatbus_conformance.trials.scripted_server import ServedConnection
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.os_evidence import holders, owner
from splatbus_conformance.trials.testee.process import FORCE, Ended
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_values import whole
from splatbus_conformance.wire.messages import Json, encode, init_packet_1_1, says_of
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

TAKES_FURTHER = (*OPENS_HOST_MEMORY, "capability:reinit")
SETTLE_SECONDS = 0.05
"""Between the end of a connection and the end of a process that died."""
NOBODY = "GPU-00000000-0000-4000-8000-00000000dead"
LONGEST_NAME = "🙂" * LIMITS["max_name_chars"]
SAFE: int = LIMITS["max_safe_integer"]
GONE_SECONDS = 2.0
FREE_SECONDS: float = LIMITS["free_seconds"]
LET_GO_SECONDS: float = LIMITS["let_go_seconds"]
SLOW_SECONDS = 0.4
"""How long a reader takes that is slow to open memory."""
SOON = 0.5
"""A server that closes a client so much sooner than it may is not merely inexact."""


def said(dealings: ServedConnection, *types: str) -> Counter[int | None]:
    """How often messages of these types named each generation."""
    heard = (message for message in dealings.heard if message.get("type") in types)
    return Counter(whole(message.get("generation")) for message in heard)


def answers(dealings: ServedConnection) -> Counter[int | None]:
    """How often each generation was answered."""
    return said(dealings, "opened", "open_failed")


def awaits_answer(trial: ClientTrial, connection: Connection, generation: int) -> bool:
    """Whether this generation is answered in time."""
    dealings = trial.with_(connection)
    trial.uses(lambda: generation in dealings.opened | dealings.failed or connection.ended)
    return generation in dealings.opened | dealings.failed


@check("OPN-1", on={CLIENT: DECLARES_HOST_MEMORY})
def check_answers_each_init_packet_once(trial: ClientTrial) -> None:
    """Good init packets, three in one segment where the testee takes further ones: rings of all
    kinds, all meanings of pixels, memory that exists and memory that does not. The name of the
    server is empty, or as long as it may be.
    """
    trial.role.offers_memory = trial.role.lends_frames = False
    name = LONGEST_NAME if trial.seed % 2 else ""
    trial.role.server = {"name": name, "version": LONGEST_NAME[len(name) :]}
    listed = [[NOWHERE], *([changed(init_packet_1_1("", 0), meaning)] for meaning in SEMANTICS)]
    most = 3 if "reinit" in trial.facts.capabilities() else 1
    drawn = st.lists(layouts(), min_size=1, max_size=most)
    with HostMemory(ROOM) as memory:
        named = {"memory/name": memory.name}
        for row in trial.each(listed, drawn, quick=5, full=100, simpler=without_one):
            connection = trial.for_init_packet()
            offers = [
                changed(it, {} if it["memory"]["name"] else named)
                | {"generation": trial.role.next_generation(connection)}
                for it in row
            ]
            connection.send(b"".join(packet(encode(offer)) for offer in offers))
            for offer in offers:
                answered = awaits_answer(trial, connection, offer["generation"])
                trial.expect(answered, "no-reply", f"no answer to {encode(offer).decode()}")
        trial.rest(REACTION_SECONDS)
        for dealings in trial.role.dealings.values():
            twice = {g: n for g, n in answers(dealings).items() if n > 1}
            trial.expect(
                not twice, "answered-twice", f"answers more than one, by generation: {twice}"
            )


@check("OPN-1", on={CLIENT: OPENS_DEVICE}, given=ring_on_device)
def check_opens_device_memory(trial: ClientTrial, _: DeviceRing) -> None:
    """A ring whose allocation, events and device are there: a client that declares `cuda_ipc` is
    able to open it, once and again on the next connection.
    """
    for _again in range(2):
        connection = trial.greeted("ipc")
        opened, heard = trial.opens(connection), trial.with_(connection).heard
        failed = [it.get("reason") for it in heard if it.get("type") == "open_failed"]
        reason = failed[0] if failed else "it did not answer"
        trial.expect(
            opened,
            "open-failed" if failed else "no-reply",
            f"it did not open good device memory: {reason}",
        )


def unusable(trial: ClientTrial, ring: DeviceRing) -> Cases:
    """What of a good init packet names something else, which is not there."""
    assert trial.device is not None, "a check of device memory needs a device"
    # Freed while the other is there, which could otherwise have its place, and its handle.
    gone = DeviceRing(trial.device, trial.role.width, trial.role.height, trial.role.slots)
    freed = gone.init_packet(1)
    gone.free()
    events = ring.init_packet(1)["ring"]["events"]
    found: list[tuple[str, Json]] = [
        ("an unknown handle of memory", {"memory/handle": UNKNOWN_HANDLE}),
        ("an unknown handle of an event", {"ring/events": [*events[:-1], UNKNOWN_HANDLE]}),
        ("memory that was freed", {"memory": freed["memory"], "ring": freed["ring"]}),
    ]
    if trial.facts.device != STAND_IN:
        found.append(("a device that is not there", {"memory/deviceUuid": NOBODY}))
    return Cases(found)


@check("INI-13", on={CLIENT: OPENS_DEVICE}, given=ring_on_device, cases=unusable, may_crash=True)
def check_goes_on_without_device_memory(
    trial: ClientTrial, ring: DeviceRing, case: tuple[str, Json]
) -> None:
    """A device that is not there (on a GPU: the stand-in tells nobody its UUID), memory that was
    freed, handles that the driver does not know.
    """
    what, changes = case
    trial.role.offers_memory = False
    outcome = outcome_of(trial, changed(ring.init_packet(1), changes))
    meaning = {"ignores": "waits", "declines": "waits", "closes": "reconnects"}
    trial.judge(meaning.get(outcome, outcome), f"an init packet with {what}")


@check("OPN-2", on={CLIENT: OPENS_HOST_MEMORY})
def check_maps_before_it_says_so(trial: ClientTrial) -> None:
    """Whenever `opened` arrives, the testee's process must have mapped the memory, as Linux shows;
    memory that does not exist is never said to be opened.
    """
    trial.role.offers_memory = trial.role.lends_frames = False
    seen = False
    for _ in range(3):
        with HostMemory(ROOM) as memory:
            connection = trial.for_init_packet()
            announce(trial, connection, init_packet_1_1(memory.name, 0))
            trial.require_open(connection)
            held = holders(memory.name)
        process = owner(connection.testee_port, trial.peer.ports["ipc"])
        what = f"it said opened, and its process {process} had not mapped the memory"
        trial.expect(held or not process, "not-mapped", what)
        seen |= bool(held)
    outcome = outcome_of(trial, NOWHERE)
    trial.expect(
        outcome != "accepts",
        "opened-missing-memory",
        "it said that it had opened memory that does not exist",
    )
    if not seen:
        trial.not_observable("what the testee has mapped is not shown here")


@check("OPN-3", on={CLIENT: DECLARES_HOST_MEMORY}, may_crash=True)
def check_says_why_it_failed(trial: ClientTrial) -> None:
    """Memory that does not exist, or is too short, and packets whose names and values are long or
    odd: whoever quotes them has to keep the reason short.
    """
    trial.role.offers_memory = False
    most: int = LIMITS["max_reason_chars"]
    odd = ("n" * 5000, "\ud800" * 2000, "\x00\n\u202e" * 500, "🙂" * 1500, ["n" * 2000])
    changes: list[Json] = [
        *({"memory/name": name} for name in odd),
        *({f"semantics/{member}": "v" * 5000} for member in ("alpha", "rows")),
        {f"memory/{'k' * 5000}": 1, "memory/bytes": int("9" * 300)},
    ]
    with HostMemory(16) as short:
        for change in trial.each([{}, *changes, {"memory/name": short.name}]):
            outcome_of(trial, changed(NOWHERE, change))
    said = [message for each in trial.role.dealings.values() for message in each.heard]
    reasons = [it.get("reason") for it in said if it.get("type") == "open_failed"]
    if not reasons:
        trial.not_observable("the testee answered open_failed to nothing")
    for reason in reasons:
        fits = isinstance(reason, str) and 1 <= len(reason) <= most
        length = f"{len(reason)} characters" if isinstance(reason, str) else repr(reason)
        trial.expect(
            fits,
            "wrong-length" if isinstance(reason, str) else "not-a-string",
            f"the reason of open_failed is {length}; 1 to {most} are asked for",
        )


@check("OPN-4", on={CLIENT: OPENS_HOST_MEMORY})
def check_keeps_the_connection_after_failing(trial: ClientTrial) -> None:
    """Memory that does not exist is announced twice, and then memory that does, where the testee
    takes further init packets.
    """
    trial.role.offers_memory = False
    connection = trial.for_init_packet()
    further = "reinit" in trial.facts.capabilities()
    for _ in range(2 if further else 1):
        if not awaits_answer(trial, connection, announce(trial, connection, NOWHERE)):
            break
    if not trial.with_(connection).failed:
        trial.not_observable("the testee answered no open_failed to memory that does not exist")
    if further:
        trial.role.offer(connection)
        waited = trial.opens(connection)
    else:
        waited = not trial.ends(connection, REACTION_SECONDS)
    trial.rest(SETTLE_SECONDS if connection.ended else 0.0)
    ended = trial.fate() or ("closes" if connection.ended else "hangs")
    trial.judge("waits" if waited else ended, "after open_failed")


@check("OPN-5", on={CLIENT: TAKES_FURTHER})
def check_closes_the_former_memory(trial: ClientTrial) -> None:
    """Four pieces of memory of different sizes follow one another, and one that does not exist;
    frames are lent meanwhile. Each former one is closed once, and nobody has it then, as Linux
    shows.
    """
    trial.role.offers_memory = False
    connection = trial.for_init_packet()
    dealings = trial.with_(connection)
    with ExitStack() as held:
        former: HostMemory | None = None
        for width in (64, 32, 64, 16, 0):
            memory = held.enter_context(HostMemory(ROOM))
            before, trial.role.width = dealings.generation, width
            good = init_packet_1_1(memory.name, 0, width) if width else NOWHERE
            generation = announce(trial, connection, good)
            if width and not trial.opens(connection):
                trial.not_observable(f"the testee did not open memory {width} pixels wide")
            if former is not None:
                trial.expect(
                    trial.closes(connection, before),
                    "not-closed",
                    f"generation {before} was not closed after {generation} came",
                )
                trial.expect(
                    not holders(former.name),
                    "still-mapped",
                    f"it closed generation {before}, and still has its memory",
                )
            former = memory
        trial.rest(REACTION_SECONDS)
        closings = dict(said(dealings, "closed"))
        once = dict.fromkeys(dealings.generations[:-1], 1)
        trial.expect(
            closings == once, "closed-too-often", f"closed was sent, by generation: {closings}"
        )


@check("OPN-6", on={CLIENT: OPENS_HOST_MEMORY})
def check_ignores_what_it_was_not_granted(trial: ClientTrial) -> None:
    """`welcome` does not list reinit; memory is opened, and a further init packet announces other
    memory. It is not answered, and a frame of the former memory is released.
    """
    trial.role.welcomes = trial.role.offers_memory = False
    granted = [name for name in trial.facts.capabilities() if name != "reinit"]
    connection = trial.connection("ipc")
    trial.says_hello(connection)
    trial.role.welcome(connection, capabilities=granted)
    dealings = trial.with_(connection)
    trial.role.offer(connection)
    trial.require_open(connection)
    former = dealings.generation
    with HostMemory(ROOM) as memory:
        further = announce(trial, connection, init_packet_1_1(memory.name, 0, 32))
        if "frames" in granted:
            seq = trial.lend(connection, generation=former)
            alive = trial.releases(connection, seq)
        else:
            alive = not trial.ends(connection, REACTION_SECONDS)
        outcome = "ignores" if alive else "hangs"
        if connection.ended and not trial.fate():
            outcome = "closes"
        if further in dealings.failed:
            outcome = "declines"
        if further in dealings.opened:
            outcome = "accepts"
        trial.judge(outcome, "a further init packet, without reinit")


@check("OPN-10", on={CLIENT: OPENS_HOST_MEMORY})
def check_leaves_the_memory_alone(trial: ClientTrial) -> None:
    """The testee opens memory and reads its slots; then the connection is closed, and the process
    ended where the harness started it.
    """
    with HostMemory(ROOM) as memory:
        memory.write(0, struct.pack("<f", 0.5) * (ROOM // 4))
        before = memory.digest()

        def expect_as_it_was(when: str) -> None:
            trial.expect(memory.exists(), "removed-memory", f"it removed the memory {when}")
            same = memory.digest() == before
            trial.expect(same, "wrote-to-memory", f"it wrote to the memory {when}")

        trial.role.memory = memory
        connection = trial.greeted("ipc")
        trial.require_open(connection)
        if "frames" in trial.facts.capabilities():
            for _ in range(trial.role.slots):
                trial.releases(connection, trial.lend(connection))
        expect_as_it_was("while it had it open")
        connection.close()
        trial.rest(REACTION_SECONDS)
        expect_as_it_was("when the connection ended")
        if trial.testee.expendable:
            trial.peer.clear()
            trial.end_testee()
        expect_as_it_was("when it ended")


def answered_before(trial: ClientTrial) -> Cases:
    """What is announced first, and then of the same generation, in words and as init packets."""
    good = trial.role.host_packet
    first = {"opened": good, "declined": NOWHERE}
    again = {
        "good memory": good,
        "memory that is not there": NOWHERE,
        "what breaks a rule": changed(good, {"semantics": ABSENT}),
    }
    return Cases(
        [
            (f"{what} for a generation that was {was}", first[was], again[what])
            for was in first
            for what in again
        ]
    )


@check("OPN-11", on={CLIENT: TAKES_FURTHER}, cases=answered_before, may_crash=True)
def check_answers_no_generation_twice(trial: ClientTrial, case: tuple[str, Json, Json]) -> None:
    """Memory is announced that is there, or is not, and when that is answered again with the same
    generation: good memory, memory that does not exist, and a packet that breaks a rule.
    """
    what, first, again = case
    trial.role.offers_memory = trial.role.lends_frames = False
    connection = trial.for_init_packet()
    generation = announce(trial, connection, first)
    if not awaits_answer(trial, connection, generation):
        trial.not_observable("the testee did not answer an init packet (OPN-1)")
    repeated = packet(encode(again | {"generation": generation}))
    outcome = trial.outcome_on_ipc(connection, repeated)
    times = answers(trial.with_(connection))[generation]
    trial.expect(times == 1, "answered-twice", f"{what}: {times} answers to it")
    going_on = outcome in ("ignores", "closes", "accepts", "declines")
    trial.judge("conforms" if going_on else outcome, what)


@check(
    "OPN-12",
    on={SERVER: ("1.1",)},
    cases=Cases(
        drawn=st.tuples(
            st.sampled_from(("opened", "open_failed", "closed")),
            st.integers(1, SAFE),
            st.booleans(),
        ),
        quick=12,
        full=300,
    ),
)
def check_ignores_generations_that_it_did_not_announce(
    trial: ServerTrial, case: tuple[str, int, bool]
) -> bool:
    """`opened`, `open_failed` and `closed` of other generations, with and without memory."""
    kind, generation, reads = case
    connection = trial.ready("ipc") if reads else trial.ready("ipc", capabilities=[])
    memory = trial.with_(connection).memory
    unknown = memory is None or memory.generation != generation
    if unknown:
        outcome = trial.outcome(connection, packet(encode(says_of(generation, kind))))
        trial.judge(outcome, f"{kind} of generation {generation}, which was not announced")
    connection.close()
    return unknown


@check(
    "OPN-8",
    on={
        SERVER_HOST: (*LENDS, "capability:host_shm"),
        SERVER_DEVICE: (*LENDS, "device", "capability:cuda_ipc"),
    },
)
def check_keeps_memory_while_somebody_has_it(trial: ServerTrial, place: Place) -> None:
    """One reader holds an image; others open the same memory, close it, fail, and leave. Whatever
    was announced is there still, as the calls of the stand-in show too, and the image is the same.
    """
    holder, frame = holding(trial)
    memory, slot = memory_of(trial, holder), int(frame["slot"])
    size, image = memory.size(), contents(memory, slot)
    for answer in trial.each(("closed", "open_failed", "opened")):
        answer_and_leave(trial, beside(trial, holder), memory.generation, answer)
        if place == "device" and not trial.facts.lacks("stand-in"):
            shown = announced(trial, holder)
            expect_kept(
                trial, shown, [it for it in shown.names if it.startswith(("memory", "ring"))]
            )
        told = f"after another reader's {answer}"
        trial.expect(
            memory.size() == size, "size-changed", f"{told} the memory has {memory.size()} bytes"
        )
        same = contents(memory, slot) == image
        trial.expect(
            same, "written-while-held", f"{told} the image that the first holds is another"
        )
    trial.viewer.release(holder, frame)
    trial.with_(holder).holds = False
    seen = trial.sees(holder, trial.move())
    trial.expect(seen, "no-frame", "after the others had left, the first was sent no further image")


def path_of(trial: ServerTrial, memory: Opened) -> Path:
    """The file that shared memory is; skips the check where that cannot be seen."""
    path = LINUX_FOLDER / memory.name
    if not path.exists():
        trial.not_observable("its memory is not listed by the system")
    return path


@check("OPN-8", on={SERVER: (*RESIZES, "opens")}, given=resizing.resizing)
def check_keeps_former_memory_until_it_is_closed(trial: ServerTrial, client: Connection) -> bool:
    """A reader holds an image while the size changes and others follow; nobody may touch what it
    reads, and images of the new size are whole.
    """
    holder, frame = holding(trial)
    dealings = trial.with_(holder)
    dealings.keeps = True
    memory, other = memory_of(trial, holder), beside(trial, holder)
    path, slot = path_of(trial, memory), int(frame["slot"])
    held = contents(memory, slot)
    resizing.changed(trial, client, other_sizes(trial)[1])
    trial.wait(lambda: dealings.kept or holder.ended, REINIT_SECONDS)
    seen = False
    for followed in trial.each(range(1, 11)):
        if holder.ended or time.monotonic() - told_at(holder) > LET_GO_SECONDS / 2:
            break  # who renders slowly may close it soon
        trial.sees(other, trial.move())
        seen = True
        told = f"after {followed} images of the new size, with an older one still held"
        trial.expect(path.exists(), "memory-gone", f"{told}, {path.name} is gone")
        same = held == contents(memory, slot)
        trial.expect(same, "written-while-held", f"{told}, that one is another")
    dealings.holds = False
    trial.viewer.let_go(holder)
    goes_on = trial.sees(holder, trial.move())
    late = holder.ended and time.monotonic() - told_at(holder) > LET_GO_SECONDS / 2
    trial.expect(
        goes_on or late, "no-frame", "once it had closed former memory, a reader saw no move"
    )
    return seen


@check("OPN-8", on={SERVER: (*RESIZES, "opens")}, given=resizing.resizing)
def check_keeps_former_memory_for_who_may_open_it(trial: ServerTrial, client: Connection) -> None:
    """A reader is sent an init packet and says nothing, as one that is slow to open it; the size
    changes, and it goes.
    """
    reader = trial.reading()
    path = path_of(trial, memory_of(trial, reader))
    trial.viewer.opens = False
    slow = trial.greeted("ipc")
    dealings = trial.with_(slow)
    trial.wait(lambda: dealings.init_packets or slow.ended)
    if slow.ended or reader.ended or not dealings.init_packets:
        trial.not_observable("the server announces its memory to one reader at a time")
    trial.viewer.opens = True
    resizing.changed(trial, client, other_sizes(trial)[0])
    trial.wait(lambda: len(trial.with_(reader).init_packets) > 1, REINIT_SECONDS)
    trial.wait(lambda: not path.exists(), 10 * SLOW_SECONDS if trial.thorough else SLOW_SECONDS)
    trial.expect(
        path.exists(),
        "memory-gone",
        f"{path.name} is gone, which a reader was told of and may open",
    )
    slow.close()


@check(
    "VPT-7",
    on={SERVER: (*RESIZES, "opens")},
    given=resizing.resizing,
    cases=lambda trial, _: Cases(
        list(zip(("closed", "open_failed"), other_sizes(trial), strict=False))
    ),
)
def check_frees_former_memory(
    trial: ServerTrial, client: Connection, case: tuple[str, Size]
) -> None:
    """Up to three readers open other memory; one closes what it had, one's connection ends, and
    the last closes it too, or says that it could not open it.
    """
    answer, size = case
    everyone = resizing.readers(trial)
    path = path_of(trial, memory_of(trial, everyone[0]))
    for reader in everyone:
        trial.with_(reader).keeps = True
    resizing.changed(trial, client, size)
    last, *others = everyone
    told = trial.wait(lambda: all(trial.with_(it).kept for it in everyone), REINIT_SECONDS)
    trial.expect(
        told, "no-init-packet", "a reader was sent no further init packet within 5 s (VPT-5)"
    )
    for each in others[::2]:
        each.close()
    for each in others[1::2]:
        trial.viewer.let_go(each)
    if answer == "closed":
        trial.viewer.let_go(last)
    else:
        former = trial.with_(last).kept[0].generation
        trial.viewer.say(last, says_of(former, answer))
    gone = trial.wait(lambda: not path.exists(), FREE_SECONDS)
    trial.expect(
        gone,
        "memory-left-behind",
        f"nobody has former memory open any more, and {path.name} is there",
    )
    for reader in everyone:
        reader.close()


@check("VPT-8", on={SERVER: RESIZES}, given=resizing.resizing)
def check_closes_who_does_not_let_go(trial: ServerTrial, client: Connection) -> None:
    """A reader opens other memory and never closes what it had, and one never says whether it had
    opened that, beside one that lets go.
    """
    keeper = trial.reading()
    trial.with_(keeper).keeps = True
    other = beside(trial, keeper)
    trial.viewer.opens = False
    silent = trial.greeted("ipc", capabilities=["host_shm", "cuda_ipc", "reinit"])
    trial.wait(lambda: trial.with_(silent).init_packets or silent.ended)
    trial.viewer.opens = True
    if keeper.ended or other.ended:
        trial.not_observable("the server ends a reader for a further one")
    late = [keeper, silent] if trial.with_(silent).init_packets else [keeper]
    resizing.changed(trial, client, other_sizes(trial)[0])
    trial.wait(lambda: trial.with_(keeper).kept or keeper.ended, REINIT_SECONDS)
    left = max(map(told_at, late)) + LET_GO_SECONDS + LIMITS["close_seconds"] - time.monotonic()
    until = trial.peer.clock() + left
    while trial.peer.clock() < until and not trial.fate():
        trial.sees(other, trial.move())
        trial.rest(SOON / 2)
        if all(reader.ended for reader in late):
            break
    for reader in late:
        seconds = (reader.gone_since or time.monotonic()) - told_at(reader)
        what = "keeps former memory" if reader is keeper else "says nothing of former memory"
        told = f"a reader that {what}, for {seconds:.1f} s"
        trial.judge(trial.fate() or ("closes" if reader.ended else "waits"), told)
        trial.expect(
            seconds >= LET_GO_SECONDS - 2 * SOON, "closed-too-early", f"{told}, was closed then"
        )
    resizing.changed(trial, client, other_sizes(trial)[1])


@check(
    "OPN-14",
    on={SERVER: RESIZES},
    given=resizing.resizing,
    cases=lambda trial, _: Cases(
        list(zip(("closed", "open_failed"), other_sizes(trial), strict=False))
    ),
)
def check_closed_ends_the_lease(
    trial: ServerTrial, client: Connection, case: tuple[str, Size]
) -> None:
    """A reader holds a frame when the size changes, opens the new memory, and says of the old that
    it has closed it, or that it could not open it; it never releases the frame, and is lent others.
    """
    answer, size = case
    holder, frame = holding(trial)
    trial.viewer.opens, dealings = False, trial.with_(holder)
    had = len(dealings.init_packets)
    resizing.changed(trial, client, size, holder)
    came = len(dealings.init_packets) > had
    trial.expect(came, "no-init-packet", "no further init packet came within 5 s (VPT-5)")
    generation = whole(dealings.init_packets[-1].get("generation"))
    trial.viewer.say(holder, says_of(frame["generation"], answer), says_of(generation, "opened"))
    before = len(dealings.frames)
    trial.move()
    trial.expect(
        trial.wait(lambda: len(dealings.frames) > before),
        "no-frame",
        f"a reader said {answer} of memory in which it held a frame, and is sent none of"
        " the memory that it has opened since",
    )
    holder.close()
    trial.viewer.opens = True


@check("OPN-9", on={SERVER: ("opens",)}, may_crash=True)
def check_leaves_no_memory_behind(trial: ServerTrial) -> None:
    """The server is asked to end; started again, and killed; and started again."""
    if not LINUX_FOLDER.is_dir():
        trial.not_observable("this system does not list shared memory")
    if not trial.testee.expendable:
        trial.not_observable("only a server that the harness launches can be ended")
    path = path_of(trial, memory_of(trial, trial.reading()))
    ended = trial.testee.stop()
    if ended is not None and not ended.crashed:
        removed = is_gone(trial, path, 0.0)  # later another may remove it, which was started beside
        trial.expect(
            removed, "memory-left-behind", f"{path.name} is left although the server {ended}"
        )
    else:  # it does not heed what it was asked: that was a kill
        expect_sweep(trial, path, ended)
    connection = trial.reading()
    left = LINUX_FOLDER / memory_of(trial, connection).name
    expect_sweep(trial, left, kill(trial, connection))


def kill(trial: ServerTrial, connection: Connection) -> Ended:
    """Kill the process at the other end of a connection, as a user does who is in a hurry."""
    process = owner(connection.testee_port, connection.port)
    if process is None:
        trial.not_observable("the process that serves cannot be found here")
    trial.killed = True
    os.kill(process, FORCE)
    trial.wait(trial.testee.ended)
    ended = trial.testee.ended()
    if ended is None:
        trial.not_observable("the launched command outlives the process that serves")
    return ended


def expect_sweep(trial: ServerTrial, left: Path, ended: Ended | None) -> None:
    """The server is started again, and has removed what the killed one left."""
    trial.peer.close_all()
    if path_of(trial, memory_of(trial, trial.reading())) != left:
        told = f"{left.name} is left by a server that {ended or 'ended'}, after another start"
        trial.expect(is_gone(trial, left), "memory-not-swept", told)


def is_gone(trial: ServerTrial, path: Path, seconds: float = GONE_SECONDS) -> bool:
    """Whether shared memory is removed, within this time; if not, it is removed here."""
    trial.peer.until(lambda: not path.exists(), seconds)
    gone = not path.exists()
    path.unlink(missing_ok=True)
    return gone
