"""Checks on what a client does with an init packet (spec 1.0 chapter 4)."""

import secrets
from collections.abc import Iterable
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.init_packets import (
    ROOM,
    BrokenInitPacket,
    breaches_of_1_0,
    changed,
    padded_rows,
    wrapping_in_32_bits,
)
from splatbus_conformance.cases.valid.init_packets import layouts, unusual_packets
from splatbus_conformance.checks import CLIENT, DECLARES_HOST_MEMORY, OPENS_HOST_MEMORY, check
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.messages import Json, encode, init_packet_1_1
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

LISTENING_SECONDS = 0.3
FIRST_EVERY = 40

OTHERS: tuple[Json, ...] = (
    {},
    {"": {}},
    {"type": None},
    {"type": 5},
    {"type": ["welcome"]},
    {"type": {"type": "welcome"}},
    {"type": ""},
    {"type": "weather_report", "sunny": True, "meta": None},
    {"type": "viewport_size", "viewport_size": [64, 48]},
    {"viewport_size": [64, 48]},
    {"position": [0, 0, 0], "rotation": [0, 0, 0, 1]},
    {"mem_color": "", "mem_depth": "", "evt_done": ""},
    {"w": 64, "h": 48, "fmtColor": "RGBA32F", "pitchColor": 1024},
)
"""JSON objects that are no init packets, nor messages of the server in 1.1."""
GOOD = "that of good memory"
TYPES: tuple[Any, ...] = ("init_packet", "weather_report", "", None, 5, {})
"""Each makes of a good init packet something else."""


def offer(trial: ClientTrial, init_packet: Json) -> tuple[bool, int]:
    """Offer memory in an init packet, its generation aside; whether it was opened, and which."""
    connection = trial.for_init_packet()
    generation = trial.role.init_packet(connection)["generation"]
    connection.send(packet(encode(init_packet | {"generation": generation})))
    return trial.opens(connection), generation


def for_broken_packet(trial: ClientTrial, number: int) -> Connection:
    """Where a broken packet goes: some are the first on their connection, by the seed.

    Few, since connections are what a testee may not afford.
    """
    first = number < 3 * FIRST_EVERY and number % FIRST_EVERY == trial.seed % FIRST_EVERY
    return trial.greeted("ipc") if first else trial.for_init_packet()


def judge_breaches(
    trial: ClientTrial, breaches: Iterable[BrokenInitPacket], kinder: dict[str, str]
) -> None:
    """Offer good memory in packets that break a rule each, and judge what becomes of each.

    `kinder` renames outcomes that satisfy the sentence under a name of another version.
    """
    trial.role.offers_memory = False
    with HostMemory(ROOM) as memory:
        chosen = trial.each(breaches, kind=lambda breach: breach.kind)
        for number, breach in enumerate(chosen):
            outcome = outcome_of(trial, breach, memory, number)
            what = f"an init packet with {breach.what} ({breach.requirement})"
            trial.judge(kinder.get(outcome, outcome), what)


def outcome_of(
    trial: ClientTrial, breach: BrokenInitPacket, memory: HostMemory, number: int
) -> str:
    """What becomes of good memory that is offered in a packet that breaks a rule."""
    connection = for_broken_packet(trial, number)
    generation = trial.role.init_packet(connection)["generation"]
    broken = packet(encode(breach.packet(memory.name, generation)))
    return trial.outcome_on_ipc(connection, broken)


@check("INI-8", observable="the testee answers opened", on={CLIENT: DECLARES_HOST_MEMORY})
def check_accepts_good_init_packets(trial: ClientTrial) -> None:
    """Sizes at both ends of their range, rings of any order and spacing, optional members, the
    longest name; and on a connection of its own the last generation, which comes first there.
    """
    trial.role.offers_memory = trial.role.lends_frames = False
    long_name = f"-_AZaz.09-splatbus-{secrets.token_hex(6)}"[: LIMITS["max_shm_name_chars"]]
    drawn = layouts().map(lambda case: (f"the ring {case['ring']}", case))
    with HostMemory(ROOM, long_name) as memory:
        for what, case in trial.each(unusual_packets(), drawn, quick=25, full=400):
            opened, _ = offer(trial, changed(case, {"memory/name": memory.name}))
            trial.expect(opened, "not-opened", f"an init packet with {what} was not opened")
            trial.delivered += 1
    connection = trial.greeted("ipc")
    dealings = trial.role.with_(connection)
    dealings.generations.append(LIMITS["max_safe_integer"] - 1)
    trial.role.offer(connection, trial.role.init_packet(connection))
    trial.expect(
        trial.opens(connection), "not-opened", f"generation {dealings.generation} was not opened"
    )


@check(
    "INI-9",
    observable="the testee does not answer opened, and opens the good memory that follows",
    on={CLIENT: OPENS_HOST_MEMORY},
    may_crash=True,
)
def check_refuses_broken_init_packets(trial: ClientTrial) -> None:
    """Each rule of INI-1 to INI-6 is broken in turn, in packets that name memory which is large
    enough. Whoever answers `open_failed` has ignored the packet, and says so.
    """
    judge_breaches(trial, [*breaches_of_1_0(), *padded_rows()], {"declines": "ignores"})


@check(
    "INI-10",
    observable="the testee does not answer opened, and opens the good memory that follows",
    on={CLIENT: OPENS_HOST_MEMORY},
    may_crash=True,
)
def check_computes_in_64_bits(trial: ClientTrial) -> None:
    """Images, offsets, strides and sizes that exceed the memory, but not modulo 2³²; the testee is
    first seen to refuse what exceeds it plainly.
    """
    trial.role.offers_memory = False
    with HostMemory(ROOM) as memory:
        plainly = BrokenInitPacket("MEM-10", {"ring/depthOffset": ROOM})
        if outcome_of(trial, plainly, memory, 0) == "accepts":
            trial.not_observable("the testee takes a ring that is larger than its memory (MEM-10)")
    refused = dict.fromkeys(("declines", "ignores", "closes"), "conforms")
    judge_breaches(trial, wrapping_in_32_bits(), refused)


@check(
    "INI-11",
    observable="the testee keeps the connection and opens the memory that follows",
    on={CLIENT: OPENS_HOST_MEMORY},
    may_crash=True,
)
def check_ignores_what_is_no_init_packet(trial: ClientTrial) -> None:
    """JSON objects of other shapes before, between and after init packets, one of the greatest
    size that a packet may have; and good init packets but for a `type`.
    """
    names = st.text("abcdefghijklmnopqrstuvwxyz", min_size=9, max_size=20)
    values = st.none() | st.booleans() | st.integers(-9, 9) | names
    drawn = st.dictionaries(names, values | st.lists(values), max_size=5)
    filler = "n" * (LIMITS["max_payload_bytes"] - len(encode({"note": ""})))
    trial.role.offers_memory = False
    typed: list[Json] = [{"meta": GOOD, "type": kind} for kind in TYPES]
    for other in trial.each([{"note": filler}, *OTHERS, *typed], drawn, quick=10, full=200):
        connection = trial.for_init_packet()
        if other.get("meta") == GOOD:
            other = {"type": other["type"], **trial.role.init_packet(connection)}
        outcome = trial.outcome_on_ipc(connection, packet(encode(other)))
        shown = encode(other)[:80].decode("ascii", "replace")
        trial.judge(outcome, f"the object {shown} on the IPC channel")


@check(
    "INI-12",
    observable="whether the testee answers opened, and whether it goes on",
    on={CLIENT: (*OPENS_HOST_MEMORY, "capability:reinit", "returns:ipc")},
)
def check_takes_a_further_init_packet(trial: ClientTrial) -> None:
    """A second init packet with other memory, where the testee declares that it takes one."""
    trial.role.offers_memory = trial.role.lends_frames = False
    for width in (64, 32):
        with HostMemory(ROOM) as memory:
            opened, generation = offer(trial, init_packet_1_1(memory.name, 0, width))
        alive = opened or trial.comes_back("ipc")
        absent = "absent" if alive else "hangs"
        trial.judge("accepts" if opened else absent, f"init packet {generation} on the connection")
        trial.delivered += 1


@check(
    "INI-13",
    observable="the testee goes on, or connects again, after memory that is not there",
    on={CLIENT: OPENS_HOST_MEMORY},
    may_crash=True,
)
def check_goes_on_without_images(trial: ClientTrial) -> None:
    """Init packets that break no rule name shared memory that does not exist, or no longer."""
    trial.role.offers_memory = False
    with HostMemory(ROOM) as memory:
        gone = memory.name
    for name in (gone, "splatbus-check-never-was"):
        connection = trial.for_init_packet()
        generation = trial.role.init_packet(connection)["generation"]
        absent = packet(encode(init_packet_1_1(name, generation)))
        outcome = trial.outcome_on_ipc(connection, absent)
        meaning = {"closes": "reconnects", "ignores": "waits", "declines": "waits"}
        trial.judge(meaning.get(outcome, outcome), "memory that does not exist")


@check(
    "INI-13",
    observable="the process lives, the IPC channel waits or returns, the message channel works",
    on={CLIENT: ("ipc",)},
    may_crash=True,
)
def check_goes_on_without_a_device(trial: ClientTrial) -> None:
    """A 1.0 server's init packet with CUDA handles that no device knows; a testee that is not known
    to come back still has to notice the end of its connection.
    """
    trial.role.speaks = "1.0"
    connection = trial.connection("ipc")
    ended = trial.uses(lambda: connection.ended, LISTENING_SECONDS)  # some load CUDA only now
    outcome = trial.fate() or ("reconnects" if ended else "waits")
    trial.role.speaks = "1.1"
    if "ipc" not in trial.facts.returns and not trial.fate():
        connection.end_stream()
        outcome = outcome if trial.ends(connection) else "hangs"
        trial.wait(trial.fate, REACTION_SECONDS)
        outcome = "dies" if trial.fate() == "dies" else outcome
        trial.delivered += 1
    for channel in sorted(trial.facts.returns):
        if not trial.comes_back(channel):
            outcome = "hangs"
    trial.judge(outcome, "CUDA memory that no device knows")
