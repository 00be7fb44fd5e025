"""Checks on the text of payloads (spec 1.0 section 2.2)."""

import contextlib
from collections.abc import Generator, Iterable, Sequence

from splatbus_conformance.cases.malformed.init_packets import (
    BrokenInitPacket,
    breaches_of_1_0,
    breaches_of_1_1,
)
from splatbus_conformance.cases.malformed.replies import BAD_REPLIES, BAD_TELEMETRY
from splatbus_conformance.cases.malformed.text import BrokenText, broken_texts
from splatbus_conformance.checks import CLIENT, OPENS_HOST_MEMORY, check
from splatbus_conformance.checks.v1_0.ini.clients import for_broken_packet
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.asking import asking
from splatbus_conformance.trials.moves.exchanges.reading import outcome_of_reading
from splatbus_conformance.trials.trial import ENDING_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.packets import packet

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
RULE_OF = {
    "welcome": "NEG-30",
    "frame": "IMG-1",
    "error": "NEG-23",
    "telemetry": "TEL-2",
    "viewport_size": "REQ-3",
    "camera": "REQ-5",
    "scene": "SCN-2",
    "pong": "PNG-2",
}
"""What a message of a type breaks that is not as it should be."""


@check(
    "JSN-8",
    observable="the testee does not open the memory that such a text announces",
    on={CLIENT: OPENS_HOST_MEMORY},
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
    "JSN-10",
    observable="the process lives and opens the good memory that follows, or comes back for it",
    on={CLIENT: OPENS_HOST_MEMORY},
    may_crash=True,
)
def check_survives_broken_payloads_on_ipc(trial: ClientTrial) -> None:
    """Broken texts, messages that miss or mistype members, and broken init packets."""
    trial.role.offers_memory = False
    texts = [*broken_texts(trial.role.legacy_init_packet()), *_odd_messages()]
    cases: list[BrokenText | BrokenInitPacket] = [*texts, *breaches_of_1_0(), *breaches_of_1_1()]
    chosen = trial.each(cases, kind=lambda broken: broken.kind)
    for number, broken in enumerate(chosen):
        connection = for_broken_packet(trial, number)
        if isinstance(broken, BrokenInitPacket):
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


@check("JSN-10", observable=GOES_ON, on={CLIENT: ("asks",)}, may_crash=True)
def check_survives_broken_payloads_on_the_message_channel(trial: ClientTrial) -> None:
    """What is no JSON object in UTF-8, in place of a reply and after it."""
    judge_row(trial, _broken_replies(trial, "JSN-1", "JSN-2"))


@check("JSN-10", observable=GOES_ON, on={CLIENT: ("asks",)}, may_crash=True)
def check_survives_names_twice_and_depths_on_the_message_channel(trial: ClientTrial) -> None:
    """Replies with equal names, and nested too deep."""
    judge_row(trial, _broken_replies(trial, "JSN-3", "JSN-5"))


@check("JSN-10", observable=GOES_ON, on={CLIENT: ("asks",)}, may_crash=True)
def check_survives_numbers_out_of_range_on_the_message_channel(trial: ClientTrial) -> None:
    """Replies with numbers that are not finite, or that no type of numbers holds."""
    judge_row(trial, _broken_replies(trial, "JSN-4"))


@check("JSN-10", observable=GOES_ON, on={CLIENT: ("asks",)}, may_crash=True)
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
    return outcome if trial.comes_back("msg") else "hangs"


def _odd_messages() -> list[BrokenText]:
    return [
        BrokenText(
            RULE_OF[message["type"]], f"the message {shorten(str(message))}", encode(message), kind
        )
        for message in ODD_MESSAGES
        for kind in [f"{message['type']} {'code' in message}"]
    ]
