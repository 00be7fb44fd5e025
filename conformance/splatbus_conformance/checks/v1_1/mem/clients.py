"""Checks on what a client does with memory of the host (spec 1.1 chapter 3)."""

import mmap
import secrets
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.init_packets import (
    ROOM,
    beyond_memory,
    breaches_of_1_1,
    changed,
)
from splatbus_conformance.checks import CLIENT, OPENS_HOST_MEMORY, Cases, check
from splatbus_conformance.images.memory.host import LINUX_FOLDER, HostMemory
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.bait import (
    for_broken_packet,
    judge_breaches,
    offer,
)
from splatbus_conformance.trials.testee.os_evidence import holders, writers
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.messages import encode, init_packet_1_1, ring_bytes
from splatbus_conformance.wire.packets import packet

PAGES = -(-ring_bytes(64, 48, 3) // mmap.ALLOCATIONGRANULARITY)
WHOLE_PAGES = PAGES * mmap.ALLOCATIONGRANULARITY
"""Bytes for a ring of 64x48 and 3 slots that no system rounds up."""


@check(
    "MEM-6",
    observable="the testee answers open_failed, lives, and opens the good memory that follows",
    on={CLIENT: OPENS_HOST_MEMORY},
    may_crash=True,
)
def check_measures_the_memory(trial: ClientTrial) -> None:
    """The memory is shorter than `bytes` by one byte, by its last slot, by all but a page, and
    by all of it; or there is none.
    """
    trial.role.offers_memory = False
    cases = (
        ("one byte shorter than announced, after the ring", WHOLE_PAGES, WHOLE_PAGES + 1),
        ("a page shorter than the ring", WHOLE_PAGES - mmap.ALLOCATIONGRANULARITY, WHOLE_PAGES),
        ("one page long", mmap.ALLOCATIONGRANULARITY, WHOLE_PAGES),
        ("empty", 0, WHOLE_PAGES),
        ("missing", None, WHOLE_PAGES),
    )
    for what, real, announced in cases:
        connection = trial.for_init_packet()
        generation = trial.role.init_packet(connection)["generation"]
        with HostMemory(real or 0) as memory:
            name = "splatbus-check-never-was" if real is None else memory.name
            offered = init_packet_1_1(name, generation)
            offered["memory"]["bytes"] = announced
            outcome = trial.outcome_on_ipc(connection, packet(encode(offered)))
            trial.judge(outcome, f"memory that is {what}")


def bad_names(held: ExitStack) -> Iterator[tuple[Any, str]]:
    """Names that break the rule, with what is wrong.

    Where the system permits, there is memory that a client without the rule would find.
    """
    token = secrets.token_hex(4)
    real = held.enter_context(HostMemory(ROOM)).name
    for path in (
        f"../shm/{real}",
        f"./{real}",
        f"/{real}",
        f"x/../{real}",
        f"../../dev/shm/{real}",
    ):
        yield path, "a path"
    for path in ("../../etc/passwd", "..", ".", "/", f"..\\{real}", f"Local\\{real}"):
        yield path, "a path"
    yield real + "\0", "NUL behind it"
    yield f"{real}\0.splatbus", "NUL in it"
    yield "", "no character"
    yield "s" * 5000, "5,000 characters"
    yield "🙂" * 1500, "1,500 characters beyond ASCII"
    yield "\x00\n\u202e" * 500, "control characters"
    most: int = LIMITS["max_shm_name_chars"]
    named = {
        f"splatbus-{token}-".ljust(most + 1, "x"): f"{most + 1} characters",
        f".splatbus-{token}": "a dot before it",
        f"splatbus-{token}\n": "a line break behind it",
        f"splatbus {token}": "a space in it",
        f"splatbus:{token}": "a colon in it",
        f"splatbus-{token}~": "a tilde behind it",
        f"splatbus-é-{token}": "a letter beyond ASCII",
        f"splatbus-٣-{token}": "a digit beyond ASCII",
    }
    for name, what in named.items():
        try:
            held.enter_context(HostMemory(ROOM, name))
        except OSError:
            what += ", and no memory of that name"
        yield name, what
    for value in (None, 5, True, [real], {"name": real}):
        yield value, "no string"


@check(
    "MEM-7",
    observable="the testee does not answer opened, and opens the good memory that follows",
    on={CLIENT: OPENS_HOST_MEMORY},
    may_crash=True,
)
def check_refuses_bad_names(trial: ClientTrial) -> None:
    """Names of shared memory that break the rule, from paths to odd characters; behind most of
    them there is memory, which a client that does not look would open.
    """
    trial.role.offers_memory = False
    with ExitStack() as held:
        for number, (name, what) in enumerate(trial.each(bad_names(held))):
            connection = for_broken_packet(trial, number)
            generation = trial.role.init_packet(connection)["generation"]
            offered = init_packet_1_1("", generation)
            offered["memory"]["name"] = name
            outcome = trial.outcome_on_ipc(connection, packet(encode(offered)))
            trial.judge(outcome, f"the name {str(name)[:60]!r} ({what})")


@check(
    "MEM-10",
    observable="the testee does not answer opened, and opens the good memory that follows",
    on={CLIENT: OPENS_HOST_MEMORY},
    may_crash=True,
)
def check_keeps_the_ring_within_the_memory(trial: ClientTrial) -> None:
    """Rings that end beyond `memory.bytes`, by a byte or by more than 64 bits hold; the memory
    itself is larger than announced.
    """
    judge_breaches(trial, beyond_memory(), {})


@check(
    "MEM-11",
    observable="the testee does not answer opened, and opens the good memory that follows",
    on={CLIENT: OPENS_HOST_MEMORY},
    may_crash=True,
)
def check_refuses_broken_members(trial: ClientTrial) -> None:
    """Each rule on `version`, `generation`, `memory`, `ring` and `semantics` is broken in turn, in
    packets that name memory which is large enough.
    """
    judge_breaches(trial, breaches_of_1_1(), {})


@check(
    "MEM-11",
    observable="the testee does not answer opened, or not a second time",
    on={CLIENT: (*OPENS_HOST_MEMORY, "capability:reinit")},
    may_crash=True,
)
def check_refuses_generations_that_do_not_grow(trial: ClientTrial) -> None:
    """The first init packet on a connection has generation 0; after two good ones come others with
    the generation of the last and of the one before it.
    """
    trial.role.offers_memory = False
    zero = trial.role.host_packet
    outcome = trial.outcome_on_ipc(trial.greeted("ipc"), packet(encode(zero)))
    trial.judge(outcome, "the first init packet with generation 0 (MEM-1)")
    for back in (0, 1):
        connection = trial.for_init_packet()
        while len(trial.role.with_(connection).opened) < 2:
            trial.role.offer(connection, trial.role.init_packet(connection))
            trial.require_open(connection)
        *_, former, newest = trial.role.with_(connection).generations
        trial.closes(connection, former, REACTION_SECONDS)
        again = (newest, former)[back]
        stale = zero | {"generation": again}
        outcome = trial.outcome_on_ipc(connection, packet(encode(stale)))
        trial.judge(outcome, f"generation {again} after generation {newest} (MEM-1)")


@check(
    "MEM-18",
    observable="the testee answers opened to init packets of later versions",
    on={CLIENT: OPENS_HOST_MEMORY},
    cases=Cases((2, 10, 11, 100), st.integers(3, 1 << 70), quick=2, full=20),
)
def check_takes_later_versions(trial: ClientTrial, minor: int) -> None:
    """Good memory is announced by a server that names a later minor version."""
    trial.role.offers_memory = False
    opened, _ = offer(trial, trial.role.host_packet | {"version": f"1.{minor}"})
    trial.expect(opened, "not-opened", f"an init packet of version 1.{minor} was not opened")
    trial.delivered += 1


@check(
    "MEM-19",
    observable="how the memory is opened when opened arrives (Linux), also where its mode is 0400",
    on={CLIENT: OPENS_HOST_MEMORY},
)
def check_opens_memory_for_reading_only(trial: ClientTrial) -> None:
    """Memory of mode 0600, then of mode 0400; whoever has it must not be able to write to it."""
    if sys.platform != "linux":
        trial.not_observable("how the testee has opened memory is not shown here")
    trial.role.offers_memory = False
    for mode in (0o600, 0o400):
        with HostMemory(trial.role.memory.size) as memory:
            (LINUX_FOLDER / memory.name).chmod(mode)
            opened, _ = offer(trial, changed(trial.role.host_packet, {"memory/name": memory.name}))
            writes, holds = writers(memory.name), holders(memory.name)
        what = f"memory of mode {mode:04o}"
        trial.expect(not writes, "opened-for-writing", f"process {writes} may write to {what}")
        trial.expect(opened, "not-opened", f"{what} was not opened")
        trial.delivered += bool(holds)
    if not trial.delivered:
        trial.not_observable("what the testee has mapped is not shown here")
