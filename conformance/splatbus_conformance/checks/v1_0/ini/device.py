"""Checks on packets and text, by the device memory that a client opens (spec 1.0 chapters 2, 4).

So they are seen of clients that say no hello too. The harness plays a server of 1.0.
"""

from collections.abc import Callable, Iterable
from contextlib import ExitStack

from hypothesis import strategies as st

from splatbus_conformance.cases.malformed.handles import UNKNOWN_HANDLE, breaches_of_handles
from splatbus_conformance.cases.malformed.init_packets import (
    BrokenInitPacket,
    breaches_of_1_0,
    changed,
)
from splatbus_conformance.cases.malformed.text import broken_texts
from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.checks.v1_0.ini.clients import OTHERS, TYPES
from splatbus_conformance.checks.v1_0.jsn.next_packet import ALONE, ignoring
from splatbus_conformance.checks.v1_0.jsn.writers import (
    AROUND,
    Writer,
    odd_spelling,
    spellings,
    unknown_members,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.device_listener import DeviceListener
from splatbus_conformance.trials.trial import ENDING_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.messages import Json, encode, init_packet_1_0
from splatbus_conformance.wire.packets import packet

OPENS = ("stand-in", "ipc")
BAIT_SIZE = 256, 192
"""Its memory has room for every image of a broken packet."""


def judge_broken(
    trial: ClientTrial,
    listening: DeviceListener,
    cases: Iterable[tuple[str, Json | bytes]],
    is_opened: Callable[[], bool],
    meaning: dict[str, str],
) -> None:
    """Send what is broken, on new connections and on some that are in use, and judge the outcome.

    `is_opened` says whether the memory that it names was opened; `meaning` renames outcomes.
    """
    for number, (what, broken) in enumerate(cases):
        payload = broken if isinstance(broken, bytes) else encode(broken)
        outcome = listening.outcome_of(packet(payload), later=number % 2 == 1)
        if is_opened():
            outcome = "accepts"
        if outcome:
            trial.judge(meaning.get(outcome, outcome), what)
    if not trial.delivered:
        trial.not_observable("the testee lives, and does not come back to show that it listens")


@check(
    "INI-9",
    observable="whether the memory of a broken packet is opened, and that of a good one after it",
    on={CLIENT: OPENS},
    may_crash=True,
)
def check_opens_nothing_of_broken_packets(trial: ClientTrial) -> None:
    """Each rule of INI-1 to INI-7 is broken in turn, in packets that name device memory which is
    large enough; first on their connection, and, where the testee takes more, after others.
    """
    with ExitStack() as held:
        listening = DeviceListener(trial, held)
        bait = listening.image(*BAIT_SIZE)
        handles = {key: text for key, text in bait.init_packet().items() if key != "meta"}

        def case(breach: BrokenInitPacket) -> tuple[str, Json]:
            offered = init_packet_1_0(breach.width, breach.height) | handles
            what = f"an init packet with {breach.what} ({breach.requirement})"
            return what, changed(offered, breach.changes)

        breaches = [*breaches_of_1_0(), *breaches_of_handles(handles)]
        returns = "ipc" in trial.facts.returns
        chosen = trial.each(breaches, kind=lambda it: it.kind if returns else it.requirement)
        judge_broken(trial, listening, map(case, chosen), lambda: bait.opened(trial.calls()), {})


@check(
    "INI-13",
    observable="the process lives, and opens the good memory that follows",
    on={CLIENT: OPENS},
    may_crash=True,
)
def check_goes_on_without_what_it_cannot_open(trial: ClientTrial) -> None:
    """Memory that was freed, handles that the driver does not know, a device that there is not."""
    with ExitStack() as held:
        listening = DeviceListener(trial, held)
        gone, good = listening.image(), listening.image().init_packet()
        freed = gone.init_packet()
        gone.free()
        unusable: dict[str, Json] = {
            "memory that was freed": dict(freed),
            "an unknown handle of colour": {"mem_color": UNKNOWN_HANDLE},
            "an unknown handle of depth": {"mem_depth": UNKNOWN_HANDLE},
            "an unknown handle of an event": {"evt_done": UNKNOWN_HANDLE},
            "device 99": {"meta/device": 99},
        }
        cases = [
            (f"an init packet with {what}", changed(good, changes))
            for what, changes in unusable.items()
        ]
        meaning = {"ignores": "waits", "closes": "reconnects"}
        judge_broken(trial, listening, trial.each(cases), lambda: False, meaning)


@check(
    "JSN-8",
    observable="whether the memory is opened that such a text announces",
    on={CLIENT: OPENS},
    may_crash=True,
)
def check_opens_nothing_of_broken_text(trial: ClientTrial) -> None:
    """Init packets of good device memory, whose text breaks JSN-1 to JSN-5 one at a time: whoever
    reads them leniently opens it.
    """
    with ExitStack() as held:
        listening = DeviceListener(trial, held)
        bait = listening.image(*BAIT_SIZE)
        texts = broken_texts(bait.init_packet())
        returns = "ipc" in trial.facts.returns
        chosen = trial.each(texts, kind=lambda it: it.kind if returns else it.requirement)
        cases = ((f"an init packet with {it.what} ({it.requirement})", it.payload) for it in chosen)
        judge_broken(trial, listening, cases, lambda: bait.opened(trial.calls()), {})


@check(
    "JSN-9",
    observable="whether the memory is opened that the next packet announces",
    on={CLIENT: OPENS},
    may_crash=True,
)
def check_opens_what_follows_broken_text(trial: ClientTrial) -> None:
    """A text that breaks a rule is followed by a good init packet; a testee that closes the
    connection instead has ignored nothing.
    """
    with ExitStack() as held, ignoring(trial) as judge:
        listening = DeviceListener(trial, held)
        for row in trial.each(ALONE, kind=lambda row: row[0].requirement, spare=5):
            connection, good = listening.fresh(), listening.image()
            opened = listening.opens(connection, good, behind=packet(row[0].payload))
            if not opened:  # a parser that has gone too deep may take its time to end
                trial.ends(connection, trial.patience)
                trial.wait(trial.fate, ENDING_SECONDS)
            if not opened and (connection.ended or trial.fate()):  # to end is to break JSN-10
                trial.charge_its_end()
                continue
            judge(row, "accepts" if opened else "hangs")
            trial.delivered += 1


@check(
    "INI-11",
    observable="whether the memory is opened that an init packet announces after other objects",
    on={CLIENT: OPENS},
    may_crash=True,
)
def check_opens_what_follows_other_objects(trial: ClientTrial) -> None:
    """JSON objects that are no init packets come before one: of other shapes, and good init packets
    but for a `type`, which name other memory.
    """
    with ExitStack() as held:
        listening = DeviceListener(trial, held)
        bait = listening.image()
        typed = [bait.init_packet() | {"type": kind} for kind in TYPES]
        rows = [typed, [*OTHERS], *([it] for it in (*typed, *OTHERS))]
        for row in trial.each(rows, kind=lambda row: (len(row), row[0] in typed)):
            connection, good = listening.fresh(), listening.image()
            others = b"".join(packet(encode(other)) for other in row)
            opened = listening.opens(connection, good, behind=others)
            outcome = "ignores" if opened else "hangs"
            if connection.ended and not opened and not trial.fate():
                outcome = "closes"
            if bait.opened(trial.calls()):
                outcome = "accepts"
            shown = shorten(encode(row[0]).decode(), 80)
            trial.judge(outcome, f"{len(row)} objects before the init packet, the first {shown}")
            trial.delivered += 1


def judge_writers(trial: ClientTrial, writers: Iterable[Writer]) -> None:
    """Announce good memory in packets that are written so; each must be opened."""
    with ExitStack() as held:
        listening = DeviceListener(trial, held)
        for writer in writers:
            connection, good = listening.fresh(), listening.image()
            payload = writer(good.init_packet())
            taken = listening.takes(connection, good, payload)
            left = "closes" if connection.ended else "ignores"
            outcome = "accepts" if taken else trial.fate() or left
            text = shorten(payload.decode(), 400)
            trial.judge(outcome, f"the message {text!r} on the IPC channel")
            trial.delivered += 1


@check("JSN-6", observable="whether the memory is opened that is announced so", on={CLIENT: OPENS})
def check_opens_any_spelling(trial: ClientTrial) -> None:
    """Init packets with members in any order, white space between all tokens, escapes in strings
    and names, numbers with fractions, exponents and many digits.
    """
    judge_writers(trial, map(odd_spelling, spellings(trial, quick=5, full=300)))


@check("JSN-7", observable="whether the memory is opened that is announced so", on={CLIENT: OPENS})
def check_opens_what_has_unknown_members(trial: ClientTrial) -> None:
    """Init packets with unknown members at every level: odd names, names from other levels, values
    nested to the limit, a decoy of the message itself.
    """
    seeds = trial.each([AROUND], st.integers(0, 2**32 - 1), quick=4, full=300)
    judge_writers(trial, (unknown_members(trial, seed) for seed in seeds))
