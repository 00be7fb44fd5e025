"""Checks on the text of payloads (spec 1.0 section 2.2)."""

import contextlib
import itertools
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from random import Random

from hypothesis import strategies as st

from splatbus_conformance.cases.malformed.init_packets import (
    Breach,
    breaches_of_1_0,
    breaches_of_1_1,
)
from splatbus_conformance.cases.malformed.replies import BAD_REPLIES, BAD_TELEMETRY
from splatbus_conformance.cases.malformed.text import BrokenText, broken_texts
from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.cases.valid.spelling import (
    LIBERTIES,
    ODD_TEXT,
    Plain,
    spell,
    spell_in_utf_8,
)
from splatbus_conformance.cases.valid.unknown_members import (
    between_unknown_members,
    with_unknown_members,
)
from splatbus_conformance.checks import OPENS_HOST_MEMORY, check
from splatbus_conformance.checks.v1_0.ini.clients import for_broken_packet
from splatbus_conformance.checks.v1_0.req.clients import (
    TIMES_AGAIN,
    answer_all,
    asking,
    asks_again_and_again,
    outcome_of_reading,
    wait_for_all,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.trial import ENDING_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.packets import packet

Writer = Callable[[Json], bytes]
Spelling = tuple[int, list[str]]
"""A seed, and the liberties that are taken."""
ROWS_ON_A_CONNECTION = 10
AT_ONCE = 8
"""Init packets in a row."""
AROUND = -1
"""In place of a seed: the unknown members stand before and behind the others."""
PAUSE_SECONDS = 0.003
"""Between payloads of a row, so that a close is seen before the next is sent."""

ODD_MESSAGES: tuple[Json, ...] = (
    {"type": "welcome"},
    {"type": "welcome", "version": 1.1, "server": None, "capabilities": {}},
    {"type": "frame"},
    {"type": "frame", "generation": "1", "seq": None, "slot": {}, "camera": []},
    {"type": "error"},
    {"type": "error", "code": 5, "message": None, "pointer": []},
    {"type": "error", "code": "\ud800", "message": "\ud800 is half a character"},
    {"type": "error", "code": "internal", "message": "m" * 100_000},
    {"type": "error", "code": ["busy"], "message": "no", "id": "1"},
    *({"type": kind, **broken} for kind, row in BAD_REPLIES.items() for broken in row),
    *({"type": "telemetry", "seq": 0, "time": 0.5, **broken} for broken in BAD_TELEMETRY),
)
"""Messages that break rules of their own; none of them announces memory."""


def odd_spelling(case: Spelling) -> Writer:
    """Writes messages as RFC 8259 allows; the size plainly, for REQ-3 asks for that."""
    seed, liberties = case
    random = Random(seed)

    def write(message: Json) -> bytes:
        if "viewport_size" in message:
            message = message | {"viewport_size": [Plain(n) for n in message["viewport_size"]]}
        return spell(message, random, liberties).encode()

    return write


def unknown_members(seed: int) -> Writer:
    """Writes messages with members that nobody knows, their characters escaped or not."""
    if seed == AROUND:
        return lambda message: encode(between_unknown_members(message))
    random = Random(seed)
    write = random.choice((encode, spell_in_utf_8))
    return lambda message: write(with_unknown_members(message, random))


def spellings(trial: ClientTrial, quick: int, full: int) -> Iterator[Spelling]:
    """Drawn spellings, most of them with all liberties."""
    some = [list(it) for n in (1, 2, 3) for it in itertools.combinations(LIBERTIES, n)]
    drawn = st.tuples(st.integers(0, 2**32 - 1), st.just(list(LIBERTIES)) | st.sampled_from(some))

    def simpler(case: Spelling) -> Iterator[Spelling]:
        seed, liberties = case
        return ((seed, fewer) for fewer in without_one(liberties) if fewer)

    return trial.each(drawn=drawn, quick=quick, full=full, simpler=simpler)


def judge_writers_on_ipc(trial: ClientTrial, writers: Iterator[Writer]) -> None:
    """Write welcome, init packets and frames so; each must have its effect.

    The full profile sends several init packets at once, so that a testee that looks for frames
    only now and then answers them all at one look.
    """
    trial.role.offers_memory = False
    trial.role.server = {"name": ODD_TEXT, "version": ODD_TEXT[::-1]}
    several = trial.thorough and "reinit" in trial.facts.capabilities()
    for number in itertools.count():
        row = list(itertools.islice(writers, AT_ONCE if several else 1))
        if not row:
            break
        written: list[bytes] = []

        def keep(payload: bytes) -> bytes:
            written.append(payload)  # noqa: B023 - the closures end with the round
            return payload

        trial.role.encode["ipc"] = lambda message: keep(row[0](message))  # noqa: B023
        anew = number % ROWS_ON_A_CONNECTION == 0
        connection = trial.greeted("ipc") if anew else trial.for_init_packet()
        dealings = trial.role.with_(connection)
        offered: dict[int, bytes] = {}
        for writer in row:
            trial.role.encode["ipc"] = lambda message: keep(writer(message))  # noqa: B023
            trial.role.offer(connection, trial.role.init_packet(connection))
            offered[dealings.generation] = written[-1]
        # To open late is to be busy, perhaps with a long message: no sentence limits that.
        taken = trial.opens(connection, trial.patience) and (
            not dealings.frames or trial.releases(connection, dealings.frames[-1], trial.patience)
        )
        refused = [offered[it] for it in offered if it not in dealings.opened]
        outcome = trial.fate() or ("closes" if connection.ended else "ignores")
        outcome = "accepts" if taken and not refused else outcome
        text = (refused or written[-1:])[0].decode()
        trial.judge(outcome, f"the message {shorten(text, 400)!r} on the IPC channel")
        trial.delivered += len(row)


def judge_writers_on_msg(
    trial: ClientTrial, writers: Iterable[Writer], *, asking_on: bool = True
) -> None:
    """Write welcome and replies so, to a request each; the testee must go on, and if `asking_on`,
    ask again after the size [0,0] and all else, where it does so after plain replies.
    """
    times = TIMES_AGAIN if asking_on and asks_again_and_again(trial) else 0
    trial.role.server = {"name": ODD_TEXT, "version": ODD_TEXT[::-1]}
    for writer in writers:
        written: list[bytes] = []

        def encode_and_keep(message: Json) -> bytes:
            written.append(writer(message))  # noqa: B023 - the closures end with the round
            return written[-1]  # noqa: B023

        trial.role.encode["msg"] = encode_and_keep
        connection = asking(trial)
        answer_all(trial, connection)
        read = wait_for_all(trial, connection, times) or not times
        # Poses go on for a while even if reading does not.
        trial.ends(connection, REACTION_SECONDS)
        outcome = outcome_of_reading(trial, connection)
        last = shorten(written[-1].decode(), 400) if written else ""
        what = f"{len(written)} messages on the message channel, the last {last!r}"
        trial.judge("accepts" if outcome == "ignores" and read else outcome, what)


@check(
    "JSN-6",
    observable="the testee opens memory and releases frames that are announced so",
    needs=OPENS_HOST_MEMORY,
)
def check_takes_any_spelling_on_ipc(trial: ClientTrial) -> None:
    """welcome, init packets and frames with members in any order, white space between all tokens,
    escapes in strings and names, numbers with fractions, exponents and many digits.
    """
    judge_writers_on_ipc(trial, map(odd_spelling, spellings(trial, quick=40, full=4000)))


@check(
    "JSN-6",
    observable="the testee goes on after replies that are spelled so",
    needs=("asks",),
)
def check_takes_any_spelling_on_the_message_channel(trial: ClientTrial) -> None:
    """The same of welcome and of the replies to the first requests."""
    judge_writers_on_msg(trial, map(odd_spelling, spellings(trial, quick=6, full=30)))


@check(
    "JSN-7",
    observable="the testee opens memory and releases frames that are announced so",
    needs=OPENS_HOST_MEMORY,
)
def check_ignores_unknown_members_on_ipc(trial: ClientTrial) -> None:
    """welcome, init packets and frames with unknown members at every level: odd names, names from
    other levels, values nested to the limit, a decoy of the message itself.
    """
    seeds = trial.each([AROUND], st.integers(0, 2**32 - 1), quick=40, full=4000)
    judge_writers_on_ipc(trial, map(unknown_members, seeds))


@check(
    "JSN-7",
    observable="the testee goes on after replies that have such members",
    needs=("asks",),
)
def check_ignores_unknown_members_on_the_message_channel(trial: ClientTrial) -> None:
    """The same of welcome and of the replies to the first requests."""
    seeds = trial.each([AROUND], st.integers(0, 2**32 - 1), quick=2, full=30)
    judge_writers_on_msg(trial, map(unknown_members, seeds))


@check(
    "JSN-8",
    observable="the testee does not open the memory that such a text announces",
    needs=OPENS_HOST_MEMORY,
    may_crash=True,
)
def check_does_not_act_on_broken_text(trial: ClientTrial) -> None:
    """Init packets of good memory, whose text breaks JSN-1 to JSN-5 one at a time: whoever reads
    them leniently opens it.
    """
    trial.role.offers_memory = False
    texts = broken_texts(trial.role.init_packet(trial.for_init_packet()))
    for number in trial.each(range(len(texts)), kind=lambda number: texts[number].kind):
        connection = for_broken_packet(trial, number)
        broken = broken_texts(trial.role.init_packet(connection))[number]
        outcome = trial.outcome_on_ipc(connection, packet(broken.payload))
        trial.judge(outcome, f"an init packet with {broken.what} ({broken.requirement})")


@check(
    "JSN-9",
    observable="the testee opens the memory that the next packet announces",
    needs=OPENS_HOST_MEMORY,
    may_crash=True,
)
def check_handles_the_next_packet_on_ipc(trial: ClientTrial) -> None:
    """After each text that breaks a rule, and after three of them at once, comes a good init
    packet; a testee that closes the connection instead has ignored nothing.
    """
    trial.role.offers_memory = False
    texts = broken_texts({"type": "weather_report", "sunny": True})
    rows = [[text] for text in texts] + [texts[i : i + 3] for i in range(0, len(texts), 3)]
    ignored = 0
    for row in trial.each(rows, kind=lambda row: (len(row), row[0].kind)):
        script = b"".join(packet(text.payload) for text in row)
        outcome = trial.outcome_on_ipc(trial.for_init_packet(), script)
        if outcome != "closes":
            trial.judge("accepts" if outcome == "ignores" else outcome, _named(row))
            ignored += 1
    if not ignored:
        trial.not_observable("the testee closes the connection on all such texts: it ignores none")


@check(
    "JSN-9",
    observable="the testee obeys NEG-16 on the packet that follows",
    needs=("hello:msg", "returns:msg"),
    may_crash=True,
)
def check_handles_the_next_packet_on_the_message_channel(trial: ClientTrial) -> None:
    """A text that breaks a rule is followed by a welcome with a version that nobody listed, on
    which the testee must close the connection; it is first seen to do so without the text.
    """
    trial.role.welcomes = False
    trial.role.replies = False  # a client that has a reply takes the server for one of 1.0 [NEG-13]
    texts = broken_texts({"type": "weather_report", "sunny": True})
    rows = trial.each([[text] for text in texts], kind=lambda row: row[0].requirement)
    ignored = 0
    for row in itertools.chain([[]], rows):
        connection = trial.connection("msg")
        trial.says_hello(connection)
        for text in row:
            connection.send(packet(text.payload))
        if row and trial.ends(connection, 10 * PAUSE_SECONDS):
            continue
        trial.role.welcome(connection, version="9.9")
        handled = trial.ends(connection)
        if not row and not handled:
            trial.not_observable("the testee does not close on a version that it did not list")
        outcome = "accepts" if handled and not trial.fate() else trial.fate() or "ignores"
        trial.judge(outcome, f"the packet after {_named(row)}")
        trial.delivered += 1
        ignored += len(row)
        trial.reassure("msg")
    if not ignored:
        trial.not_observable("the testee closes the connection on all such texts: it ignores none")


@check(
    "JSN-10",
    observable="the process lives and opens the good memory that follows, or comes back for it",
    needs=OPENS_HOST_MEMORY,
    may_crash=True,
)
def check_survives_broken_payloads_on_ipc(trial: ClientTrial) -> None:
    """Broken texts, messages that miss or mistype members, and broken init packets."""
    trial.role.offers_memory = False
    texts = [*broken_texts(trial.role.legacy_init_packet()), *_odd_messages()]
    cases: list[BrokenText | Breach] = [*texts, *breaches_of_1_0(), *breaches_of_1_1()]
    chosen = trial.each(cases, kind=lambda broken: broken.kind)
    for number, broken in enumerate(chosen):
        connection = for_broken_packet(trial, number)
        if isinstance(broken, Breach):
            generation = trial.role.init_packet(connection)["generation"]
            payload = encode(broken.packet(trial.role.memory.name, generation))
        else:
            payload = broken.payload
        outcome = trial.outcome_on_ipc(connection, packet(payload))
        if outcome == "accepts":
            outcome = trial.outcome_on_ipc(trial.for_init_packet())
        what = f"a packet with {broken.what} ({broken.requirement})"
        trial.judge("ignores" if outcome in ("accepts", "declines") else outcome, what)


GOES_ON = "the process lives, and the testee goes on or connects again"


@check("JSN-10", observable=GOES_ON, needs=("asks",), may_crash=True)
def check_survives_broken_payloads_on_the_message_channel(trial: ClientTrial) -> None:
    """What is no JSON object in UTF-8, in place of a reply and after it."""
    judge_row(trial, _broken_replies(trial, "JSN-1", "JSN-2"))


@check("JSN-10", observable=GOES_ON, needs=("asks",), may_crash=True)
def check_survives_names_twice_and_depths_on_the_message_channel(trial: ClientTrial) -> None:
    """Replies with equal names, and nested too deep."""
    judge_row(trial, _broken_replies(trial, "JSN-3", "JSN-5"))


@check("JSN-10", observable=GOES_ON, needs=("asks",), may_crash=True)
def check_survives_numbers_out_of_range_on_the_message_channel(trial: ClientTrial) -> None:
    """Replies with numbers that are not finite, or that no type of numbers holds."""
    judge_row(trial, _broken_replies(trial, "JSN-4"))


@check("JSN-10", observable=GOES_ON, needs=("asks",), may_crash=True)
def check_survives_odd_messages_on_the_message_channel(trial: ClientTrial) -> None:
    """Messages that miss or mistype members, in place of a reply and after it."""
    judge_row(trial, _odd_messages())


def _broken_replies(trial: ClientTrial, *requirements: str) -> list[BrokenText]:
    texts = broken_texts({"viewport_size": [trial.role.width, trial.role.height]})
    return [text for text in texts if text.requirement in requirements]


def judge_row(trial: ClientTrial, payloads: Sequence[BrokenText]) -> None:
    """Send broken payloads in a row; where that goes wrong, each by itself."""
    chosen: list[BrokenText] = []
    spare = None if "msg" in trial.facts.returns else 0  # each of these may cost a start

    def delivered() -> Generator[BrokenText]:  # one after the other, for each may take a connection
        for broken in trial.each(payloads, kind=lambda broken: broken.kind, spare=spare):
            chosen.append(broken)
            yield broken

    with contextlib.closing(delivered()) as row:
        outcome = outcome_of_row(trial, row)
    if outcome not in trial.requirement.acceptable:
        for broken in chosen:
            alone = outcome_of_row(trial, [broken])
            trial.judge(alone, f"{broken.what} ({broken.requirement}) on the msg channel")
    trial.judge(outcome, f"{len(chosen)} broken payloads in a row on the msg channel")


def outcome_of_row(trial: ClientTrial, payloads: Iterable[BrokenText]) -> str:
    """Send payloads one after the other, again on a new connection when the testee closes one.

    Returns `ignores` or `closes` if it connects again at the end, or notices the end where it is
    not known to return; else how it fared. That poses come all the while would not do: who sends
    them need not be who listens.
    """
    returns = "msg" in trial.facts.returns
    connection = asking(trial)
    for broken in payloads:
        if connection.ended and not returns:
            trial.wait(trial.fate, ENDING_SECONDS)
            if fate := trial.fate():
                return fate
            trial.delivered += 1  # it has closed, and lives
        if connection.ended:
            again = trial.next_connection("msg") if returns else asking(trial)
            if again is None:
                break
            connection = again
        connection.send(packet(broken.payload))
        trial.ends(connection, PAUSE_SECONDS)
        if fate := trial.fate():
            return fate
    if not returns:
        return outcome_of_reading(trial, connection)
    outcome = "closes" if connection.ended else "ignores"
    return outcome if trial.comes_back("msg") else trial.fate() or "hangs"


def _odd_messages() -> list[BrokenText]:
    return [
        BrokenText("NEG-23", f"the message {shorten(str(message))}", encode(message), kind)
        for message in ODD_MESSAGES
        for kind in [f"{message['type']} {'code' in message}"]
    ]


def _named(row: Sequence[BrokenText]) -> str:
    return " and ".join(f"{text.what} ({text.requirement})" for text in row)
