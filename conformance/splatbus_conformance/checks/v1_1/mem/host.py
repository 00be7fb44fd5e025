"""Checks on shared memory of the host: what a server makes, and what a client may make of what it
is offered (spec 1.1 chapter 3).
"""

import mmap
import os
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
from splatbus_conformance.checks import CLIENT, OPENS_HOST_MEMORY, SERVER, Cases, check
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.images.memory.reading import LINUX_FOLDER, Opened
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.agreement import named
from splatbus_conformance.trials.moves.exchanges.bait import (
    for_broken_packet,
    judge_breaches,
    offer,
)
from splatbus_conformance.trials.moves.frame_readers import memory_of
from splatbus_conformance.trials.moves.memory_offers import NOWHERE, outcome_of
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.os_evidence import holders, writers
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import encode, ring_bytes, says_of
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

OTHERS = 0o077
"""Permission bits of everybody but the owner."""
PAGE = mmap.ALLOCATIONGRANULARITY
WHOLE_PAGES = -(-ring_bytes(64, 48, 3) // PAGE) * PAGE
"""Bytes for a ring of 64x48 and 3 slots that no system rounds up."""


@check(
    "MEM-6",
    on={CLIENT: OPENS_HOST_MEMORY},
    may_crash=True,
)
def check_measures_the_memory(trial: ClientTrial) -> None:
    """The memory is shorter than `bytes` by one byte, by its last slot, by all but a page, and
    by all of it; or there is none.
    """
    trial.role.offers_memory = False
    for what, real, announced in (
        ("one byte shorter than announced, after the ring", WHOLE_PAGES, WHOLE_PAGES + 1),
        ("a page shorter than the ring", WHOLE_PAGES - PAGE, WHOLE_PAGES),
        ("one page long", PAGE, WHOLE_PAGES),
        ("empty", 0, WHOLE_PAGES),
        ("missing", None, WHOLE_PAGES),
    ):
        with HostMemory(real or 0) as memory:
            there = {} if real is None else {"memory/name": memory.name}
            offered = changed(NOWHERE, {**there, "memory/bytes": announced})
            trial.judge(outcome_of(trial, offered), f"memory that is {what}")


def bad_names(held: ExitStack) -> Iterator[tuple[Any, str]]:
    """Names that break the rule, with what is wrong.

    Where the system permits, there is memory that a client without the rule would find.
    """
    token = secrets.token_hex(4)
    real = held.enter_context(HostMemory(ROOM)).name
    for path in (
        *(f"../shm/{real}", f"./{real}", f"/{real}", f"x/../{real}", f"../../dev/shm/{real}"),
        *("../../etc/passwd", "..", ".", "/", f"..\\{real}", f"Local\\{real}"),
    ):
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
            offered = changed(NOWHERE, {"memory/name": name})
            outcome = outcome_of(trial, offered, for_broken_packet(trial, number))
            trial.judge(outcome, f"the name {str(name)[:60]!r} ({what})")


@check(
    "MEM-10",
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
    on={CLIENT: (*OPENS_HOST_MEMORY, "capability:reinit")},
    may_crash=True,
)
def check_refuses_generations_that_do_not_grow(trial: ClientTrial) -> None:
    """The first init packet on a connection has generation 0; after two good ones come others with
    the generation of the last and of the one before it.
    """
    trial.role.offers_memory = False
    good = trial.role.host_packet
    outcome = trial.outcome_on_ipc(trial.greeted("ipc"), packet(encode(good)))
    trial.judge(outcome, "the first init packet with generation 0 (MEM-1)")
    for back in (0, 1):
        connection = trial.for_init_packet()
        while len(trial.with_(connection).opened) < 2:
            trial.role.offer(connection)
            trial.require_open(connection)
        *_, former, newest = trial.with_(connection).generations
        trial.closes(connection, former, REACTION_SECONDS)
        again = (newest, former)[back]
        stale = packet(encode(good | {"generation": again}))
        outcome = trial.outcome_on_ipc(connection, stale)
        trial.judge(outcome, f"generation {again} after generation {newest} (MEM-1)")


@check(
    "MEM-18",
    on={CLIENT: OPENS_HOST_MEMORY},
    cases=Cases((2, 10, 11, 100), st.integers(3, 1 << 70), quick=2, full=20),
)
def check_takes_later_versions(trial: ClientTrial, minor: int) -> None:
    """Good memory is announced by a server that names a later minor version."""
    trial.role.offers_memory = False
    opened, _ = offer(trial, trial.role.host_packet | {"version": f"1.{minor}"})
    trial.expect(opened, "not-opened", f"an init packet of version 1.{minor} was not opened")


@check(
    "MEM-19",
    on={CLIENT: OPENS_HOST_MEMORY},
)
def check_opens_memory_for_reading_only(trial: ClientTrial) -> bool:
    """Memory of mode 0600, then of mode 0400; whoever has it must not be able to write to it."""
    if sys.platform != "linux":
        trial.not_observable("how the testee has opened memory is not shown here")
    trial.role.offers_memory = False
    shown = False
    for mode in (0o600, 0o400):
        with HostMemory(trial.role.memory.size) as memory:
            (LINUX_FOLDER / memory.name).chmod(mode)
            opened, _ = offer(trial, changed(trial.role.host_packet, {"memory/name": memory.name}))
            writes, held = writers(memory.name), holders(memory.name)
        what = f"memory of mode {mode:04o}"
        trial.expect(not writes, "opened-for-writing", f"process {writes} may write to {what}")
        trial.expect(opened, "not-opened", f"{what} was not opened")
        shown |= bool(held)
    return shown


def shown(trial: ServerTrial, connection: Connection) -> Opened:
    """The memory that is open on a connection, if its size and mode are shown here."""
    memory = memory_of(trial, connection)
    if memory.size() is None or memory.mode() is None:
        trial.not_observable("this system does not show the size and mode of shared memory")
    return memory


@check("MEM-1", on={SERVER: ("opens",)})
def check_speaks_the_version_that_it_announces(trial: ServerTrial) -> None:
    """Says hello anew, with the version of the init packet before 1.1."""
    connection = trial.ready("ipc")
    told = trial.with_(connection).init_packets
    connection.close()
    announced = told[-1].get("version") if told else None
    if not isinstance(announced, str):
        trial.not_observable("no init packet names a version")
    spoken = named(trial, "ipc", [announced, "1.1"])
    trial.expect(
        spoken == announced,
        "wrong-version",
        f"it announces {show(announced)}, and a client of that version is told {show(spoken)}",
    )


@check("MEM-4", on={SERVER: ("opens",)})
def check_lets_only_its_user_in(trial: ServerTrial) -> None:
    """Reads the permissions of the memory that is announced."""
    mode = shown(trial, trial.reading()).mode() or 0
    trial.expect(
        mode & OTHERS == 0, "others-may-open", f"others may open the memory: its mode is {mode:04o}"
    )


@check("MEM-4", on={SERVER: ("opens",)}, may_crash=True)
def check_creates_memory_of_its_own(trial: ServerTrial) -> None:
    """Launches the server anew, where a file has the name that its memory had before."""
    memory = shown(trial, trial.reading())
    if not trial.testee.expendable:
        trial.not_observable("only a server that the harness launches can be launched anew")
    path = LINUX_FOLDER / memory.name
    trial.peer.close_all()
    trial.testee.stop()
    path.unlink(missing_ok=True)
    with path.open("xb") as planted:
        path.chmod(0o600)
        try:
            used = LINUX_FOLDER / memory_of(trial, trial.reading()).name
            same = used.exists() and used.stat().st_ino == os.fstat(planted.fileno()).st_ino
            trial.expect(not same, "not-its-own", f"{path.name} was there before, and is used")
        finally:
            trial.peer.close_all()
            trial.testee.stop()
            path.unlink(missing_ok=True)


@check("MEM-5", on={SERVER: ("opens",)})
def check_keeps_the_size(trial: ServerTrial) -> None:
    """The camera moves, readers come and go, one fails to open it; then the server ends."""
    connection = trial.reading()
    memory = shown(trial, connection)
    size = memory.size()
    for message in (
        says_of(memory.generation, "open_failed"),
        says_of(memory.generation, "closed"),
        {"type": "subscribe", "channels": ["depth"]},
    ):
        other = trial.reading()
        trial.viewer.say(other, message)
        trial.move()
        trial.rest(0.02)
        other.close()
        trial.expect(
            memory.size() == size,
            "size-changed",
            f"its size was {size:,}, and is {memory.size():,}",
        )
    if trial.testee.expendable:
        trial.testee.stop()
        now = memory.size()
        trial.expect(
            now == size,
            "size-changed",
            f"its size was {size:,}, and {now:,} after the server ended",
        )
