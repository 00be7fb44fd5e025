"""Checks on payloads that are not as they should be, at either end: JSN (spec 1.0 section 2.2)."""

import contextlib
import itertools
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from operator import attrgetter, itemgetter

from hypothesis import strategies as st

from splatbus_conformance.cases.malformed.handles import breaches_of_handles
from splatbus_conformance.cases.malformed.init_packets import (
    BrokenInitPacket,
    breaches_of_1_0,
    breaches_of_1_1,
)
from splatbus_conformance.cases.malformed.poses import broken_poses
from splatbus_conformance.cases.malformed.replies import BAD_REPLIES, BAD_TELEMETRY
from splatbus_conformance.cases.malformed.text import BrokenText, broken_texts
from splatbus_conformance.checks import (
    CLIENT,
    CLIENT_DEVICE,
    CLIENT_IPC,
    CLIENT_MSG,
    OPENS_HOST_MEMORY,
    SERVER,
    SERVER_IPC,
    SERVER_MSG,
    Cases,
    Place,
    check,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.agreement import unwelcome
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.moves.device_listener import DEVICE, DeviceListener, listening
from splatbus_conformance.trials.moves.exchanges.asking import asking
from splatbus_conformance.trials.moves.exchanges.bait import Bait, DeviceBait, baited
from splatbus_conformance.trials.moves.exchanges.exchange import (
    exchange,
    in_use,
    judge_if_seen,
    refusal,
    require_refusal,
)
from splatbus_conformance.trials.moves.exchanges.reading import outcome_of_reading
from splatbus_conformance.trials.moves.exchanges.unheard import (
    outcome_at_the_end,
    silent_connection,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import ENDING_SECONDS, SETTLE_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.messages import Json, camera_pose, encode, hello, init_packet_1_0
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection

Trial = ClientTrial | ServerTrial
REQUESTS: tuple[Json, ...] = (
    VIEWPORT_REQUEST,
    {"type": "get_camera_pose", "cam_idx": 0},
    {"type": "get_camera_pose", "cam_idx": -9_007_199_254_740_991},
    {"type": "get_camera_pose", "cam_idx": 1_000_000, "timestamp": 1_700_000_000.25},
    {"type": "get_viewport_size", "timestamp": 5e-324},
)
FAR: Json = camera_pose((30.5, -20.25, 10.125), (0.5, -0.5, 0.5, 0.5))
"""A good pose that no check asks for otherwise."""
SPARE = 12
"""Broken texts that the quick profile delivers beside one of each kind, where each takes long."""
Row = Sequence[BrokenText]
Broken = BrokenText | BrokenInitPacket


def named(row: Sequence[Broken]) -> str:
    """What is wrong with texts."""
    return " and ".join(f"{text.what} ({text.requirement})" for text in row)


def payload_of(broken: Broken, bait: Bait) -> bytes:
    """A broken text as it is, and bait in a packet that is broken otherwise."""
    return broken.payload if isinstance(broken, BrokenText) else encode(bait.packet(broken))


def shown(payload: bytes) -> str:
    """A payload, cut when it is long."""
    return shorten(repr(payload)[1:], 300)


# Nobody acts on broken text


def _texts_of_bait(trial: ClientTrial, place: Place, bait: Bait) -> Cases:
    texts = broken_texts(bait.packet())
    alike = isinstance(bait, DeviceBait) and "ipc" not in trial.facts.returns
    kind = attrgetter("requirement" if alike else "kind")
    return Cases(range(len(texts)), kind=lambda number: kind(texts[number]))


@check(
    "JSN-8",
    on={CLIENT_IPC: OPENS_HOST_MEMORY, CLIENT_DEVICE: DEVICE},
    given=baited,
    cases=_texts_of_bait,
    may_crash=True,
)
def check_does_not_act_on_broken_text(
    trial: ClientTrial, place: Place, bait: Bait, number: int
) -> bool:
    """Init packets of good memory, whose text breaks JSN-1 to JSN-5 one at a time: whoever reads
    them leniently opens it.
    """
    text = broken_texts(bait.packet())[number]
    return judge_if_seen(trial, bait.outcome(text.payload), f"an init packet with {named([text])}")


@check(
    "JSN-8",
    on={SERVER: ()},
    cases=Cases([*broken_texts(REQUESTS[3]), *broken_texts(hello([]))], kind=attrgetter("kind")),
    may_crash=True,
)
def check_does_not_answer_broken_text(trial: ServerTrial, text: BrokenText) -> None:
    """Requests whose text breaks JSN-1 to JSN-5 one at a time, and `hello` too: whoever reads them
    leniently answers.
    """
    outcome = trial.outcome_on_msg(in_use(trial), packet(text.payload))
    trial.judge(outcome, named([text]))


@contextmanager
def steering(trial: ServerTrial) -> Iterator[CameraControl]:
    """Frames that show a good pose, of the message connection in use."""
    control = CameraControl(trial)
    moved = control.shows(in_use(trial), camera_pose())
    trial.expect(moved, "not-applied", "no frame shows a good pose")
    yield control


@check(
    "JSN-8",
    on={SERVER: ("frames",)},
    given=steering,
    cases=Cases(broken_texts(FAR), kind=attrgetter("kind"), spare=SPARE),
    may_crash=True,
)
def check_does_not_move_by_broken_text(
    trial: ServerTrial, control: CameraControl, text: BrokenText
) -> None:
    """Poses whose text breaks JSN-1 to JSN-5: afterwards the camera is where it was."""
    outcome = control.outcome_of(in_use(trial), text.payload)
    trial.judge("ignores" if outcome == "keeps" else outcome, f"a pose with {named([text])}")


# What follows it is handled

CLOSING_SECONDS = 0.03
"""For a testee to close on such a text, before what follows is sent."""
TEXTS = broken_texts({"type": "weather_report", "sunny": True})
ALONE: list[Row] = [[text] for text in TEXTS]
FIRST: Row = TEXTS[:2]
"""They come before `welcome`, to a client."""
ROWS = [*ALONE, FIRST, *(TEXTS[place : place + 3] for place in range(0, len(TEXTS), 3))]
ANSWERED = {"ignores", "replies", "reports"}
Ignoring = tuple[DeviceListener | None, Callable[[Row, str], bool]]


def kind_of_row(row: Row) -> tuple[int, str]:
    """What texts in a row are one of."""
    return len(row), row[0].kind


def requirement_of_row(row: Row) -> str:
    """What the first of them breaks."""
    return row[0].requirement


@contextmanager
def ignoring(trial: Trial, place: Place) -> Iterator[Ignoring]:
    """What listens in device memory, and what judges the packet behind texts. A testee may close
    the connection instead; where it does so for all of them, nothing can be said.
    """
    if isinstance(trial, ServerTrial) and place == "ipc":
        trial.greeted("ipc").close()
    elif place == "msg" and isinstance(trial, ClientTrial):
        require_refusal(trial)
    ignored: list[Row] = []

    def judge(row: Row, outcome: str) -> bool:
        if outcome == "closes":
            return False
        trial.judge(outcome, f"{place}: the packet after {named(row)}")
        ignored.append(row)
        return True

    with listening(trial, place) as listener:
        yield listener, judge
    if not ignored:
        trial.not_observable("the testee closes the connection on all such texts: it ignores none")


@check(
    "JSN-9",
    on={
        CLIENT_IPC: OPENS_HOST_MEMORY,
        CLIENT_DEVICE: DEVICE,
        CLIENT_MSG: ("hello:msg", "returns:msg"),
        SERVER_IPC: ("1.1",),
        SERVER_MSG: (),
    },
    given=ignoring,
    cases={
        CLIENT_IPC: Cases(ROWS, kind=kind_of_row),
        CLIENT_DEVICE: Cases(ALONE, kind=requirement_of_row, spare=5),
        CLIENT_MSG: Cases(ALONE, kind=requirement_of_row),
        SERVER_IPC: Cases(ALONE, kind=kind_of_row, spare=SPARE),
        SERVER_MSG: Cases(ROWS, kind=kind_of_row),
    },
    may_crash=True,
)
def check_handles_the_next_packet(trial: Trial, place: Place, given: Ignoring, row: Row) -> bool:
    """After each text that breaks a rule, and after three of them at once, comes a packet that has
    an effect: memory is opened (once after two that came before `welcome`), a request answered,
    hello welcomed, a version refused. Whoever closes the connection instead has ignored nothing.
    """
    listener, judge = given
    texts = b"".join(packet(text.payload) for text in row)
    if isinstance(trial, ServerTrial):
        if place == "ipc":
            return judge(row, _outcome_before(trial, texts))
        outcome = trial.outcome_on_msg(in_use(trial), texts)
    elif place == "msg":
        return judge(row, _outcome_before(trial, texts))
    elif listener:
        outcome = listener.outcome_before(texts)
        if trial.fate():  # to end is to break JSN-10
            trial.charge_its_end()
            return False
    elif row == FIRST:
        connection = unwelcome(trial, "ipc")
        connection.send(texts)
        trial.role.welcomes = True
        trial.role.welcome(connection)
        outcome = trial.outcome_on_ipc(connection)
    else:
        trial.role.offers_memory = False
        outcome = trial.outcome_on_ipc(trial.for_init_packet(), texts)
    return judge(row, "accepts" if outcome in ANSWERED else outcome)


def _outcome_before(trial: Trial, texts: bytes) -> str:
    """Of the first packet that the testee awaits: hello, or a welcome."""
    it = refusal(trial) if isinstance(trial, ClientTrial) else exchange(trial, "ipc")
    assert it is not None, "a server can always be asked"
    it.connection.send(texts)
    if trial.ends(it.connection, CLOSING_SECONDS):
        return "closes"
    it.connection.send(b"".join(it.packets))
    if it.taken():
        return "accepts"
    return trial.fate() or ("closes" if it.connection.ended else "hangs")


# Nobody dies of it

TO_CLIENTS: tuple[Json, ...] = (
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
ODD_MESSAGES = [
    BrokenText(
        RULE_OF[message["type"]],
        f"the message {shorten(str(message))}",
        encode(message),
        f"{message['type']} {'code' in message}",
    )
    for message in TO_CLIENTS
]


OF_1_0: list[Broken] = [*broken_texts(init_packet_1_0()), *breaches_of_1_0()]


@check(
    "JSN-10",
    on={CLIENT_IPC: OPENS_HOST_MEMORY},
    given=baited,
    cases=Cases([*OF_1_0, *ODD_MESSAGES, *breaches_of_1_1()], kind=attrgetter("kind")),
    may_crash=True,
)
def check_survives_broken_payloads_on_ipc(
    trial: ClientTrial, place: Place, bait: Bait, broken: Broken
) -> None:
    """Broken texts, messages that miss or mistype members, and broken init packets: the process
    lives and opens the good memory that follows, or comes back for it.
    """
    outcome = bait.outcome(payload_of(broken, bait))
    if outcome == "accepts":
        outcome = trial.outcome_on_ipc(trial.for_init_packet())
    what = f"a packet with {named([broken])}"
    trial.judge("ignores" if outcome in ("accepts", "declines") else outcome, what)


ON_A_CONNECTION = 8
PAUSE_SECONDS = 0.003
"""Between payloads of a row, so that a close is seen before the next is sent."""


@check("JSN-10", on={CLIENT_IPC: ("ipc",)}, given=baited, may_crash=True)
def check_survives_broken_payloads_unheard(trial: ClientTrial, place: Place, bait: Bait) -> None:
    """Broken texts and broken 1.0 init packets, a few to a connection, and a good packet after
    them, for a testee that says nothing on the IPC channel. That it connects again, or notices the
    end of the connection, shows that what listens there is alive.
    """
    handles = {name: it for name, it in init_packet_1_0().items() if name != "meta"}
    payloads = trial.each([*OF_1_0, *breaches_of_handles(handles)], kind=attrgetter("kind"))
    while row := list(itertools.islice(payloads, ON_A_CONNECTION)):
        outcome = _outcome_of_silent_row(trial, bait, row)
        if outcome not in trial.requirement.acceptable:
            for broken in row:
                alone = _outcome_of_silent_row(trial, bait, [broken])
                trial.judge(alone, f"ipc: {named([broken])}")
        trial.judge(outcome, f"ipc: {named(row)}")


def _outcome_of_silent_row(trial: ClientTrial, bait: Bait, row: Sequence[Broken]) -> str:
    connection = silent_connection(trial)
    for broken in row:
        if connection.ended:
            outcome = outcome_at_the_end(trial, connection)
            if outcome != "lives":
                return outcome
            connection = silent_connection(trial)
        connection.send(packet(payload_of(broken, bait)))
        trial.ends(connection, PAUSE_SECONDS)
    connection.send(packet(encode(trial.role.legacy_init_packet())))
    closed = trial.ends(connection, SETTLE_SECONDS)
    outcome = outcome_at_the_end(trial, connection)
    return ("closes" if closed else "ignores") if outcome == "lives" else outcome


# Four checks, for each broken reply may cost a testee that is slow a start.


@check("JSN-10", on={CLIENT: ("asks",)}, may_crash=True)
def check_survives_broken_payloads_on_the_message_channel(trial: ClientTrial) -> bool:
    """What is no JSON object in UTF-8, in place of a reply and after it."""
    return judge_row(trial, _broken_replies(trial, "JSN-1", "JSN-2"))


@check("JSN-10", on={CLIENT: ("asks",)}, may_crash=True)
def check_survives_names_twice_and_depths_on_the_message_channel(trial: ClientTrial) -> bool:
    """Replies with equal names, and nested too deep."""
    return judge_row(trial, _broken_replies(trial, "JSN-3", "JSN-5"))


@check("JSN-10", on={CLIENT: ("asks",)}, may_crash=True)
def check_survives_numbers_out_of_range_on_the_message_channel(trial: ClientTrial) -> bool:
    """Replies with numbers that are not finite, or that no type of numbers holds."""
    return judge_row(trial, _broken_replies(trial, "JSN-4"))


@check("JSN-10", on={CLIENT: ("asks",)}, may_crash=True)
def check_survives_odd_messages_on_the_message_channel(trial: ClientTrial) -> bool:
    """Messages that miss or mistype members, in place of a reply and after it."""
    return judge_row(trial, ODD_MESSAGES)


def _broken_replies(trial: ClientTrial, *requirements: str) -> Row:
    texts = broken_texts({"viewport_size": [trial.role.width, trial.role.height]})
    return [text for text in texts if text.requirement in requirements]


def judge_row(trial: ClientTrial, payloads: Row) -> bool:
    """Send broken payloads in a row; where that goes wrong, each by itself. Whether it was seen
    what became of them.
    """
    chosen: list[BrokenText] = []
    spare = None if "msg" in trial.facts.returns else 0  # each of these may cost a start

    def delivered() -> Generator[BrokenText]:  # one after the other, for each may take a connection
        for broken in trial.each(payloads, kind=lambda broken: broken.kind, spare=spare):
            chosen.append(broken)
            yield broken

    before = trial.controls
    with contextlib.closing(delivered()) as row:
        outcome = outcome_of_row(trial, row)
    if outcome not in trial.requirement.acceptable:
        for broken in chosen:
            trial.judge(outcome_of_row(trial, [broken]), f"msg: {named([broken])}")
    trial.judge(outcome, f"msg: {len(chosen)} broken payloads in a row")
    return trial.controls > before


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
            trial.controls += 1  # it has closed, and lives
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


TO_SERVERS: tuple[Json, ...] = (
    {"type": "hello"},
    {"type": "hello", "versions": 1.1, "client": None, "capabilities": {}},
    {"type": "hello", "versions": [[]], "client": {"name": 5}, "capabilities": [None]},
    {"type": "get_camera_pose"},
    {"type": "get_camera_pose", "cam_idx": [0]},
    {"type": "get_camera_pose", "cam_idx": 1.5},
    {"type": "get_camera_pose", "cam_idx": 10**300},
    {"type": "get_viewport_size", "timestamp": "now"},
    {"type": "get_viewport_size", "id": {"": []}},
    {"type": "opened", "generation": -1},
    {"type": "release", "generation": "1", "seq": None},
    {"type": "closed"},
    {"type": "open_failed", "generation": 1e300, "reason": 5},
    {"type": "subscribe", "channels": "color"},
    {"type": {"type": "camera_pose"}},
    {"type": "\x00" * 1000},
    {"type": "weather_report", "report": "r" * 1_000_000},
    {"type": "object_pose", "object": {}, "scale": "large"},
    camera_pose() | {"intrinsics": [], "tag": 5},
    camera_pose() | {"intrinsics": {"fx": 1e300, "width": -1}},
    {"type": "set_time", "time": None},
    {"type": "set_viewport", "width": 1e300, "height": 0.5},
    {"type": "subscribe_telemetry", "names": {"all": True}},
    {"type": "ping", "t": []},
)
"""Messages that break rules of their own."""
Payload = tuple[object, bytes]
"""What it is one of, and its text."""


def odd_payloads(good: Json) -> list[Payload]:
    """Payloads that break a rule of their text, or of their message."""
    found: list[Payload] = [(text.kind, text.payload) for text in broken_texts(good)]
    return [*found, *((str(it.get("type")), encode(it)) for it in TO_SERVERS)]


def mangled() -> st.SearchStrategy[Payload]:
    """Payloads that were good before some of their bytes were lost, doubled or changed."""
    goods = [encode(message) for message in (*REQUESTS, FAR, hello(["host_shm"]))]
    edit = st.tuples(st.integers(0, 200), st.binary(max_size=3), st.integers(0, 3))
    whole = st.tuples(st.sampled_from(goods), st.lists(edit, min_size=1, max_size=4))
    edited = whole.map(lambda drawn: _edited(*drawn)) | st.binary(min_size=1, max_size=64)
    return st.tuples(st.none(), edited)


def _edited(payload: bytes, edits: Sequence[tuple[int, bytes, int]]) -> bytes:
    for place, put, gone in edits:
        at = place % len(payload) if payload else 0
        payload = payload[:at] + put + payload[at + gone :]
    return payload or b"\x00"


@check(
    "JSN-10",
    on={SERVER: ()},
    cases=Cases(
        [*odd_payloads(FAR), *((it.requirement, it.payload) for it in broken_poses(FAR))],
        *(mangled(), itemgetter(0)),
        quick=60,
        full=3000,
    ),
    may_crash=True,
)
def check_survives_broken_payloads(trial: ServerTrial, case: Payload) -> None:
    """Broken texts, broken poses, messages that miss or mistype members, and payloads of any
    bytes, on the message channel: the process lives and answers the request that follows, or the
    next client.
    """
    _, payload = case
    outcome = trial.outcome_on_msg(in_use(trial), packet(payload))
    answered = outcome in ("replies", "reports")
    trial.judge("ignores" if answered else outcome, f"the payload {shown(payload)}")


@contextmanager
def _one_connection(trial: ServerTrial, channel: Channel) -> Iterator[list[Connection]]:
    """The IPC connection in use, last; in the end the server has come to the last payload, and
    serves the next client.
    """
    connections = [trial.dial("ipc")]
    yield connections
    if trial.facts.welcome["ipc"]:
        connections[-1].send(packet(encode(hello(["host_shm"]))))
        trial.is_welcomed(connections[-1])  # or it is ended
    if fate := trial.fate():
        trial.judge(fate, "broken payloads in a row")
    trial.judge("ignores" if trial.serves() else "hangs", "broken payloads in a row")


@check(
    "JSN-10",
    on={SERVER_IPC: ()},
    given=_one_connection,
    cases=Cases(
        odd_payloads(hello(["host_shm"])), mangled(), kind=itemgetter(0), quick=60, full=1000
    ),
    may_crash=True,
)
def check_survives_broken_payloads_of_readers(
    trial: ServerTrial, channel: Channel, connections: list[Connection], case: Payload
) -> None:
    """The same, all of them on one IPC connection as long as that lasts."""
    _, payload = case
    if connections[-1].ended:
        connections[-1].close()
        connections.append(trial.dial("ipc"))
    connections[-1].send(packet(payload))
    trial.rest(0.0)
    if fate := trial.fate():
        trial.judge(fate, f"the payload {shown(payload)} on the IPC channel")
