"""Checks on opening, failing to open, and closing (spec 1.1 chapter 4)."""

import struct
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.init_packets import ABSENT, ROOM, changed
from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.cases.valid.init_packets import SEMANTICS, layouts
from splatbus_conformance.checks import CLIENT, DECLARES_HOST_MEMORY, OPENS_HOST_MEMORY, check
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.testee.os_evidence import holders, owner
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_values import whole
from splatbus_conformance.wire.messages import Json, encode, init_packet_1_1
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

NOWHERE = "splatbus-check-never-was"
TAKES_FURTHER = (*OPENS_HOST_MEMORY, "capability:reinit")
SETTLE_SECONDS = 0.05
"""Between the end of a connection and the end of a process that died."""
ANSWERS = ("opened", "open_failed")
LONGEST_NAME = "🙂" * LIMITS["max_name_chars"]


def said(trial: ClientTrial, connection: Connection, *types: str) -> Counter[int | None]:
    """How often messages of these types named each generation."""
    heard = trial.role.with_(connection).heard
    return Counter(whole(m.get("generation")) for m in heard if m.get("type") in types)


def awaits_answer(trial: ClientTrial, connection: Connection, generation: int) -> bool:
    """Whether this generation is answered in time."""
    dealings = trial.role.with_(connection)
    trial.uses(lambda: generation in dealings.opened | dealings.failed or connection.ended)
    return generation in dealings.opened | dealings.failed


def names_memory(init_packet: Json) -> bool:
    """The name of the memory is no longer open."""
    return bool(init_packet["memory"]["name"])


@check(
    "OPN-1",
    observable="the number of opened and open_failed for each generation",
    on={CLIENT: DECLARES_HOST_MEMORY},
)
def check_answers_each_init_packet_once(trial: ClientTrial) -> None:
    """Good init packets, three in one segment where the testee takes further ones: rings of all
    kinds, all meanings of pixels, memory that exists and memory that does not. The name of the
    server is empty, or as long as it may be.
    """
    trial.role.offers_memory = trial.role.lends_frames = False
    name = LONGEST_NAME if trial.seed % 2 else ""
    trial.role.server = {"name": name, "version": LONGEST_NAME[len(name) :]}
    with HostMemory(ROOM) as memory:
        named = {"memory/name": memory.name}
        meanings = [[changed(init_packet_1_1("", 0), meaning)] for meaning in SEMANTICS]
        most = 3 if "reinit" in trial.facts.capabilities() else 1
        drawn = st.lists(layouts(), min_size=1, max_size=most)
        rows = trial.each(
            [[init_packet_1_1(NOWHERE, 0)], *meanings],
            drawn,
            quick=5,
            full=100,
            simpler=without_one,
        )
        used: set[Connection] = set()
        for cases in rows:
            row = [case if names_memory(case) else changed(case, named) for case in cases]
            connection = trial.for_init_packet()
            used.add(connection)
            for offer in row:
                offer["generation"] = trial.role.init_packet(connection)["generation"]
            connection.send(b"".join(packet(encode(offer)) for offer in row))
            for offer in row:
                answered = awaits_answer(trial, connection, offer["generation"])
                trial.expect(answered, "no-reply", f"no answer to {encode(offer).decode()}")
                trial.delivered += 1
        trial.rest(REACTION_SECONDS)
        for connection in used:
            twice = {g: n for g, n in said(trial, connection, *ANSWERS).items() if n > 1}
            trial.expect(
                not twice, "answered-twice", f"answers more than one, by generation: {twice}"
            )


@check(
    "OPN-2",
    observable="which processes hold the memory when opened arrives (Linux); no opened for none",
    on={CLIENT: OPENS_HOST_MEMORY},
)
def check_maps_before_it_says_so(trial: ClientTrial) -> None:
    """Whenever `opened` arrives, the testee's process must have mapped the memory; memory that does
    not exist is never said to be opened.
    """
    trial.role.offers_memory = trial.role.lends_frames = False
    seen = False
    for _ in range(3):
        with HostMemory(ROOM) as memory:
            connection = trial.for_init_packet()
            generation = trial.role.init_packet(connection)["generation"]
            trial.role.offer(connection, init_packet_1_1(memory.name, generation))
            trial.require_open(connection)
            held = holders(memory.name)
        process = owner(connection.testee_port, trial.peer.ports["ipc"])
        if held or process:
            what = f"it said opened, and its process {process} had not mapped the memory"
            trial.expect(held, "not-mapped", what)
            seen = True
            trial.delivered += 1
    connection = trial.for_init_packet()
    generation = trial.role.init_packet(connection)["generation"]
    absent = packet(encode(init_packet_1_1(NOWHERE, generation)))
    outcome = trial.outcome_on_ipc(connection, absent)
    trial.expect(
        outcome != "accepts",
        "opened-missing-memory",
        "it said that it had opened memory that does not exist",
    )
    if not seen:
        trial.not_observable("what the testee has mapped is not shown here")


@check(
    "OPN-3",
    observable="the reason in each open_failed",
    on={CLIENT: DECLARES_HOST_MEMORY},
    may_crash=True,
)
def check_says_why_it_failed(trial: ClientTrial) -> None:
    """Memory that does not exist, or is too short, and packets whose names and values are long or
    odd: whoever quotes them has to keep the reason short.
    """
    trial.role.offers_memory = False
    most: int = LIMITS["max_reason_chars"]
    odd = ("n" * 5000, "\ud800" * 2000, "\x00\n\u202e" * 500, "🙂" * 1500, ["n" * 2000])
    cases: list[Json] = [init_packet_1_1(NOWHERE, 0)]
    cases += [init_packet_1_1(name, 0) for name in odd]  # type: ignore[arg-type]
    cases += [changed(cases[0], {f"semantics/{m}": "v" * 5000}) for m in ("alpha", "rows")]
    cases += [changed(cases[0], {f"memory/{'k' * 5000}": 1, "memory/bytes": int("9" * 300)})]
    reasons = []
    with HostMemory(16) as short:
        cases.append(init_packet_1_1(short.name, 0))
        for case in trial.each(cases):
            connection = trial.for_init_packet()
            case["generation"] = trial.role.init_packet(connection)["generation"]
            trial.outcome_on_ipc(connection, packet(encode(case)))
            heard = trial.role.with_(connection).heard
            failed = [m for m in heard if m.get("type") == "open_failed"]
            reasons += [
                m.get("reason") for m in failed if m.get("generation") == case["generation"]
            ]
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


@check(
    "OPN-4",
    observable="the connection stays open, and good memory is opened on it",
    on={CLIENT: OPENS_HOST_MEMORY},
)
def check_keeps_the_connection_after_failing(trial: ClientTrial) -> None:
    """Memory that does not exist is announced twice, and then memory that does, where the testee
    takes further init packets.
    """
    trial.role.offers_memory = False
    connection = trial.for_init_packet()
    dealings = trial.role.with_(connection)
    further = "reinit" in trial.facts.capabilities()
    for _ in range(2 if further else 1):
        generation = trial.role.init_packet(connection)["generation"]
        trial.role.offer(connection, init_packet_1_1(NOWHERE, generation))
        if not awaits_answer(trial, connection, generation):
            break
    if not dealings.failed:
        trial.not_observable("the testee answered no open_failed to memory that does not exist")
    if further:
        trial.role.offer(connection, trial.role.init_packet(connection))
        waited = trial.opens(connection)
    else:
        waited = not trial.ends(connection, REACTION_SECONDS)
    trial.rest(SETTLE_SECONDS if connection.ended else 0.0)
    ended = trial.fate() or ("closes" if connection.ended else "hangs")
    trial.judge("waits" if waited else ended, "after open_failed")
    trial.delivered += 1


@check(
    "OPN-5",
    observable="closed for each former generation, once; that nobody holds its memory then (Linux)",
    on={CLIENT: TAKES_FURTHER},
)
def check_closes_the_former_memory(trial: ClientTrial) -> None:
    """Four pieces of memory of different sizes follow one another; frames are lent meanwhile."""
    trial.role.offers_memory = False
    connection = trial.for_init_packet()
    dealings = trial.role.with_(connection)
    with ExitStack() as held:
        former: HostMemory | None = None
        for width in (64, 32, 64, 16):
            memory = held.enter_context(HostMemory(ROOM))
            before, trial.role.width = dealings.generation, width
            generation = trial.role.init_packet(connection)["generation"]
            trial.role.offer(connection, init_packet_1_1(memory.name, generation, width))
            if not trial.opens(connection):
                trial.not_observable(f"the testee did not open memory {width} pixels wide")
            if former is not None:
                trial.expect(
                    trial.closes(connection, before),
                    "not-closed",
                    f"generation {before} was not closed after {generation} came",
                )
                still = holders(former.name)
                trial.expect(
                    not still,
                    "still-mapped",
                    f"it closed generation {before}, and still has its memory",
                )
                trial.delivered += 1
            former = memory
        trial.rest(REACTION_SECONDS)
        closings = dict(said(trial, connection, "closed"))
        once = dict.fromkeys(dealings.generations[:-1], 1)
        trial.expect(
            closings == once, "closed-too-often", f"closed was sent, by generation: {closings}"
        )


@check(
    "OPN-6",
    observable="no answer to the further init packet; a frame of the former memory is released",
    on={CLIENT: OPENS_HOST_MEMORY},
)
def check_ignores_what_it_was_not_granted(trial: ClientTrial) -> None:
    """`welcome` does not list reinit; memory is opened, and a further init packet announces other
    memory.
    """
    trial.role.welcomes = trial.role.offers_memory = False
    granted = [name for name in trial.facts.capabilities() if name != "reinit"]
    connection = trial.connection("ipc")
    trial.says_hello(connection)
    trial.role.welcome(connection, capabilities=granted)
    dealings = trial.role.with_(connection)
    trial.role.offer(connection, trial.role.init_packet(connection))
    trial.require_open(connection)
    former = dealings.generation
    with HostMemory(ROOM) as memory:
        further = trial.role.init_packet(connection)["generation"]
        trial.role.offer(connection, init_packet_1_1(memory.name, further, 32))
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
        trial.delivered += 1


@check(
    "OPN-10",
    observable="the memory is there and unchanged after the testee has read it, closed, and ended",
    on={CLIENT: OPENS_HOST_MEMORY},
)
def check_leaves_the_memory_alone(trial: ClientTrial) -> None:
    """The testee opens memory and reads its slots; then the connection is closed, and the process
    ended where the harness started it.
    """
    with HostMemory(ROOM) as memory:
        memory.write(0, struct.pack("<f", 0.5) * (ROOM // 4))
        before = memory.digest()
        trial.role.memory = memory
        connection = trial.greeted("ipc")
        trial.require_open(connection)
        if "frames" in trial.facts.capabilities():
            for _ in range(trial.role.slots):
                trial.releases(connection, trial.lend(connection))
        trial.expect(
            memory.digest() == before,
            "wrote-to-memory",
            "it wrote to the memory while it had it open",
        )
        connection.close()
        trial.rest(REACTION_SECONDS)
        trial.expect(
            memory.exists(), "removed-memory", "it removed the memory when the connection ended"
        )
        if trial.testee.expendable:
            trial.peer.clear()
            trial.end_testee()
        trial.expect(
            memory.exists(), "removed-memory", "the memory was removed when the testee ended"
        )
        trial.expect(
            memory.digest() == before, "wrote-to-memory", "it wrote to the memory before it ended"
        )
        trial.delivered += 1


def answered_before(trial: ClientTrial) -> Iterator[tuple[str, Json, Json]]:
    """What is announced first, and then of the same generation, in words and as init packets."""
    good, nowhere = trial.role.host_packet, init_packet_1_1(NOWHERE, 0)
    broken = changed(good, {"semantics": ABSENT})
    for first, was in ((good, "opened"), (nowhere, "declined")):
        for again in (good, nowhere, broken):
            what = "what breaks a rule" if again is broken else again["memory"]["name"]
            yield f"{what} for a generation that was {was}", first, again


@check(
    "OPN-11",
    observable="no second answer to a generation that is announced again",
    on={CLIENT: TAKES_FURTHER},
    may_crash=True,
)
def check_answers_no_generation_twice(trial: ClientTrial) -> None:
    """Memory is announced that is there, or is not, and when that is answered again with the same
    generation: good memory, memory that does not exist, and a packet that breaks a rule.
    """
    trial.role.offers_memory = trial.role.lends_frames = False
    for what, first, again in trial.each(list(answered_before(trial))):
        connection = trial.for_init_packet()
        generation = trial.role.init_packet(connection)["generation"]
        named = {"generation": generation}
        trial.role.offer(connection, first | named)
        if not awaits_answer(trial, connection, generation):
            trial.not_observable("the testee did not answer an init packet (OPN-1)")
        outcome = trial.outcome_on_ipc(connection, packet(encode(again | named)))
        answers = said(trial, connection, *ANSWERS)[generation]
        trial.expect(answers == 1, "answered-twice", f"{what}: {answers} answers to it")
        going_on = outcome in ("ignores", "closes", "accepts", "declines")
        trial.judge("conforms" if going_on else outcome, what)
