"""Checks on what a client does with an init packet: INI (spec 1.0 chapter 4)."""

import secrets
from contextlib import ExitStack
from operator import attrgetter
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.handles import breaches_of_handles
from splatbus_conformance.cases.malformed.init_packets import (
    ROOM,
    BrokenInitPacket,
    breaches_of_1_0,
    changed,
    padded_rows,
    wrapping_in_32_bits,
)
from splatbus_conformance.cases.rings import GAP, MOST_GAPS, ORDERS, Arrangement
from splatbus_conformance.cases.valid.init_packets import layouts, unusual_packets
from splatbus_conformance.checks import (
    CLIENT,
    CLIENT_DEVICE,
    CLIENT_IPC,
    DECLARES_HOST_MEMORY,
    OPENS_HOST_MEMORY,
    Cases,
    Place,
    check,
)
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.images.painted import coordinates
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.device_listener import DEVICE
from splatbus_conformance.trials.moves.exchanges.bait import (
    Bait,
    DeviceBait,
    baited,
    judge_breach,
    offer,
)
from splatbus_conformance.trials.moves.exchanges.exchange import judge_if_seen
from splatbus_conformance.trials.moves.frame_lender import READS, FrameLender
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.messages import Json, encode, init_packet_1_1
from splatbus_conformance.wire.packets import packet

# Good packets


@check("INI-8", on={CLIENT: DECLARES_HOST_MEMORY})
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
    connection = trial.greeted("ipc")
    dealings = trial.with_(connection)
    dealings.generations.append(LIMITS["max_safe_integer"] - 1)
    trial.role.offer(connection)
    trial.expect(
        trial.opens(connection), "not-opened", f"generation {dealings.generation} was not opened"
    )


Size = tuple[int, int, int]
"""Width and height in pixels, and how many slots."""
Ring = tuple[Size, Arrangement]
ODD: tuple[Ring, ...] = (
    ((31, 17, 3), Arrangement(ORDERS[0], GAP, GAP, GAP)),
    ((2, 3, 2), Arrangement(ORDERS[1], 0, 2 * GAP, GAP)),
    ((1, 5, 4), Arrangement(ORDERS[2], 3 * GAP, GAP, 0)),
    ((64, 1, 2), Arrangement(ORDERS[1], 5 * GAP)),
)
"""Rows of depth that end between two multiples of 16, in every order, with gaps everywhere."""
OFFSETS: dict[str, Any] = {"meta/offsetColor": 16 * GAP, "meta/offsetDepth": 4}
"""Members that have no meaning in a ring."""
GAPS = st.integers(0, MOST_GAPS).map(lambda gaps: GAP * gaps)
RINGS = st.tuples(
    st.tuples(st.integers(1, 48), st.integers(1, 48), st.integers(1, 6)),
    st.builds(Arrangement, st.sampled_from(ORDERS), GAPS, GAPS, GAPS),
)


@check("INI-8", on={CLIENT: (*READS, "returns:ipc")})
def check_shows_what_any_ring_holds(trial: ClientTrial) -> None:
    """Rings of every order and spacing, of odd sizes, one after the other; the packets have the
    offsets of 1.0 too, which have no meaning there. In each, every slot is lent once.
    """
    role = trial.role
    role.offers_memory = role.lends_frames = False
    with ExitStack() as held:
        role.memory = held.enter_context(HostMemory(ROOM))
        for size, arrangement in trial.each(ODD, RINGS, quick=4, full=60):
            connection = trial.for_init_packet()
            role.width, role.height, role.slots = size
            role.arrange(Arrangement(*arrangement))
            offered = changed(role.init_packet(connection), OFFSETS)
            role.offer(connection, offered)
            ring = f"the ring {offered['ring']} of images of {size[0]}x{size[1]}"
            trial.expect(trial.opens(connection), "not-opened", f"{ring} was not opened")
            lender = FrameLender(trial, connection)
            for number in range(role.slots):
                lender.show(coordinates(number, *lender.size))
                _judge_shown(trial, lender, f"of {ring}")


@check("CHN-24", on={CLIENT: (*READS, "returns:ipc")})
def check_shows_the_memory_of_the_new_connection(trial: ClientTrial) -> None:
    """The connection is lost and comes back, and each time there is other memory, whose size and
    images are as before.
    """
    with ExitStack() as held:
        for number in range(4):
            trial.role.memory = held.enter_context(HostMemory(trial.role.memory.size))
            lender = FrameLender(trial)
            lender.show(coordinates(number, *lender.size))
            _judge_shown(trial, lender, "was read in memory that a reconnect has put in place")
        trial.peer.close_all()


def _judge_shown(trial: ClientTrial, lender: FrameLender, where: str) -> None:
    answer = trial.ask("digest")
    if answer["seq"] not in lender.shown:
        trial.not_observable("the client shows no image that was lent")
    if wrong := lender.misread(answer):
        trial.violated("other-pixels", f"image {answer['seq']} {where}: {wrong}")


@check("INI-12", on={CLIENT: (*OPENS_HOST_MEMORY, "capability:reinit", "returns:ipc")})
def check_takes_a_further_init_packet(trial: ClientTrial) -> None:
    """A second init packet with other memory, where the testee declares that it takes one."""
    trial.role.offers_memory = trial.role.lends_frames = False
    for width in (64, 32):
        with HostMemory(ROOM) as memory:
            opened, generation = offer(trial, init_packet_1_1(memory.name, 0, width))
        alive = opened or trial.comes_back("ipc")
        absent = "absent" if alive else "hangs"
        trial.judge("accepts" if opened else absent, f"init packet {generation} on the connection")


# Broken packets


def _breaches(trial: ClientTrial, place: Place, bait: Bait) -> Cases:
    if isinstance(bait, DeviceBait):
        breaches = [*breaches_of_1_0(), *breaches_of_handles(bait.handles)]
        by_kind = "ipc" in trial.facts.returns
        return Cases(breaches, kind=attrgetter("kind" if by_kind else "requirement"))
    return Cases([*breaches_of_1_0(), *padded_rows()], kind=attrgetter("kind"))


@check(
    "INI-9",
    on={CLIENT_IPC: OPENS_HOST_MEMORY, CLIENT_DEVICE: DEVICE},
    given=baited,
    cases=_breaches,
    may_crash=True,
)
def check_refuses_broken_init_packets(
    trial: ClientTrial, place: Place, bait: Bait, breach: BrokenInitPacket
) -> bool:
    """Each rule of INI-1 to INI-7 is broken in turn, in packets that name memory which is large
    enough; it must not be opened. Whoever answers `open_failed` has ignored the packet, and says
    so.
    """
    return judge_breach(trial, bait, breach, {"declines": "ignores"})


def _wrapping(trial: ClientTrial, place: Place, bait: Bait) -> Cases:
    plainly = BrokenInitPacket("MEM-10", {"ring/depthOffset": ROOM})
    if bait.outcome(encode(bait.packet(plainly))) == "accepts":
        trial.not_observable("the testee takes a ring that is larger than its memory (MEM-10)")
    return Cases(wrapping_in_32_bits(), kind=attrgetter("kind"))


@check(
    "INI-10",
    on={CLIENT_IPC: OPENS_HOST_MEMORY},
    given=baited,
    cases=_wrapping,
    may_crash=True,
)
def check_computes_in_64_bits(
    trial: ClientTrial, place: Place, bait: Bait, breach: BrokenInitPacket
) -> bool:
    """Images, offsets, strides and sizes that exceed the memory, but not modulo 2³²; the testee is
    first seen to refuse what exceeds it plainly.
    """
    refused = dict.fromkeys(("declines", "ignores", "closes"), "conforms")
    return judge_breach(trial, bait, breach, refused)


# Other objects

GOOD = "that of good memory"
TYPES: tuple[Any, ...] = ("init_packet", "weather_report", "", None, 5, {})
TYPED: list[Json] = [{"meta": GOOD, "type": kind} for kind in TYPES]
"""Each makes of a good init packet something else."""
FILLER = "n" * (LIMITS["max_payload_bytes"] - len(encode({"note": ""})))
OTHERS: list[Json] = [
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
]
"""JSON objects that are no init packets, nor messages of the server in 1.1."""
ROWS = [[*TYPED, *OTHERS], TYPED, OTHERS, [{"note": FILLER}], *([it] for it in (*TYPED, *OTHERS))]
NAMES = st.text("abcdefghijklmnopqrstuvwxyz", min_size=9, max_size=20)
VALUES = st.none() | st.booleans() | st.integers(-9, 9) | NAMES
DRAWN = st.dictionaries(NAMES, VALUES | st.lists(VALUES), max_size=5).map(lambda it: [it])


def _kind_of_row(row: list[Json]) -> tuple[int, bool]:
    return len(row), row[0] in TYPED


def _other_objects(trial: ClientTrial, place: Place, bait: Bait) -> Cases:
    if place == "ipc" and trial.facts.speaks_1_1("ipc"):
        return Cases(ROWS, DRAWN, quick=10, full=200)
    return Cases(ROWS, kind=_kind_of_row)


@check(
    "INI-11",
    on={CLIENT_IPC: ("ipc", "opens:unless-silent"), CLIENT_DEVICE: DEVICE},
    given=baited,
    cases=_other_objects,
    may_crash=True,
)
def check_ignores_what_is_no_init_packet(
    trial: ClientTrial, place: Place, bait: Bait, row: list[Json]
) -> bool:
    """JSON objects of other shapes before, between and after init packets, one of the greatest
    size that a packet may have; and good init packets but for a `type`. The testee keeps the
    connection and opens the memory that follows, or notices the end of the connection.
    """
    good = bait.packet()
    payloads = [encode(good | {"type": it["type"]} if it.get("meta") == GOOD else it) for it in row]
    outcome = bait.outcome_before(b"".join(map(packet, payloads)))
    shown = shorten(payloads[0].decode(), 80)
    what = f"{len(row)} objects before the init packet, the first {shown}"
    return judge_if_seen(trial, outcome, what)


# Memory that is not there


@check(
    "INI-13",
    on={CLIENT_IPC: OPENS_HOST_MEMORY, CLIENT_DEVICE: DEVICE},
    given=baited,
    cases=lambda trial, place, bait: Cases([*bait.unusable().items()]),
    may_crash=True,
)
def check_goes_on_without_images(
    trial: ClientTrial, place: Place, bait: Bait, case: tuple[str, Json]
) -> bool:
    """Init packets that break no rule name memory that does not exist, or no longer, handles that
    the driver does not know, a device that there is not.
    """
    what, changes = case
    outcome = bait.outcome(encode(bait.packet(BrokenInitPacket("", changes))))
    meaning = {"closes": "reconnects", "ignores": "waits", "declines": "waits"}
    return judge_if_seen(trial, meaning.get(outcome, outcome), f"an init packet with {what}")


LISTENING_SECONDS = 0.3


@check("INI-13", on={CLIENT: ("ipc",)}, may_crash=True)
def check_goes_on_without_a_device(trial: ClientTrial) -> None:
    """A 1.0 server's init packet with CUDA handles that no device knows: the testee lives, and
    waits or returns; one that is not known to come back still has to notice the end of its
    connection.
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
    for channel in sorted(trial.facts.returns):
        if not trial.comes_back(channel):
            outcome = "hangs"
    trial.judge(outcome, "CUDA memory that no device knows")
