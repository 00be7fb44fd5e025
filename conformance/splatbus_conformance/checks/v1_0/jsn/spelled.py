"""Checks on how messages are spelled, at either end: JSN (spec 1.0 section 2.2)."""

import itertools
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from functools import cache, partial

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.valid.spelling import ODD_TEXT
from splatbus_conformance.checks import (
    CLIENT,
    CLIENT_DEVICE,
    CLIENT_IPC,
    CLIENT_MSG,
    OPENS_HOST_MEMORY,
    SERVER_HOST,
    SERVER_IPC,
    SERVER_MSG,
    Cases,
    End,
    Needs,
    Place,
    check,
)
from splatbus_conformance.checks.v1_0.jsn.broken import REQUESTS, shown
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.moves.device_listener import DEVICE, DeviceListener
from splatbus_conformance.trials.moves.exchanges.asking import asking
from splatbus_conformance.trials.moves.exchanges.exchange import in_use
from splatbus_conformance.trials.moves.exchanges.reading import (
    SIZE,
    TIMES_AGAIN,
    answer_all,
    asked_after_plain_replies,
    outcome_of_reading,
    wait_for_all,
)
from splatbus_conformance.trials.moves.shown_image import image_of
from splatbus_conformance.trials.moves.writers import (
    ALL,
    AROUND,
    MOST_OFTEN_ALL,
    SEEDS,
    Spelling,
    Writer,
    noting,
    odd_spelling,
    of_length,
    unknown_members,
    with_less,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import GONE_SECONDS
from splatbus_conformance.trials.trial import EFFECT_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.message_kinds import POSES
from splatbus_conformance.wire.messages import Json, camera_pose, encode, intrinsics
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

Trial = ClientTrial | ServerTrial


def _judge(trial: Trial, connection: Connection, taken: bool, what: str) -> None:
    left = "closes" if connection.ended else "ignores"
    trial.judge("accepts" if taken else trial.fate() or left, what)


# Clients

Judge = Callable[[Writer], bool | None]
"""Judges whether what this writes is read; False where nothing shows it."""
ODD_NAME = (ODD_TEXT * LIMITS["max_name_chars"])[: LIMITS["max_name_chars"]]
ODDLY_NAMED = {"name": ODD_NAME, "version": ODD_NAME[::-1]}
ROWS_ON_A_CONNECTION = 10
AT_ONCE = 8
"""Init packets in a row."""


@contextmanager
def of_announcements(trial: ClientTrial) -> Iterator[Judge]:
    """Of welcome, init packets and frames, each of which must have its effect.

    The full profile sends several init packets at once, so that a testee that looks for frames
    only now and then answers them all at one look.
    """
    trial.role.offers_memory = False
    trial.role.server = ODDLY_NAMED
    most = AT_ONCE if trial.thorough and "reinit" in trial.facts.capabilities() else 1
    row: list[Writer] = []
    rows = itertools.count()

    def judge_row() -> None:
        _judge_row(trial, row, anew=next(rows) % ROWS_ON_A_CONNECTION == 0)
        row.clear()

    def judge(writer: Writer) -> bool:
        row.append(writer)
        if len(row) < most:
            return False
        judge_row()
        return True

    yield judge
    if row:
        judge_row()


def _judge_row(trial: ClientTrial, row: list[Writer], *, anew: bool) -> None:
    written: list[bytes] = []
    trial.role.encode["ipc"] = noting(row[0], written)
    connection = trial.greeted("ipc") if anew else trial.for_init_packet()
    dealings = trial.with_(connection)
    offered: dict[int, bytes] = {}
    for writer in row:
        trial.role.encode["ipc"] = noting(writer, written)
        trial.role.offer(connection)
        offered[dealings.generation] = written[-1]
    # To open late is to be busy, perhaps with a long message: no sentence limits that.
    taken = trial.opens(connection, trial.patience) and (
        not dealings.frames or trial.releases(connection, dealings.frames[-1], trial.patience)
    )
    refused = [offered[it] for it in offered if it not in dealings.opened]
    text = shorten((refused or written[-1:])[0].decode(), 400)
    _judge(trial, connection, taken and not refused, f"the message {text!r} on the IPC channel")


@contextmanager
def of_images(trial: ClientTrial) -> Iterator[Judge]:
    """Of init packets of a server of 1.0, whose device memory must be opened."""
    with ExitStack() as held:
        listener = DeviceListener(trial, held)

        def judge(writer: Writer) -> None:
            connection, image = listener.fresh(), listener.image()
            payload = writer(image.init_packet())
            taken = listener.takes(connection, image, payload)
            _judge(trial, connection, taken, f"the init packet {shown(payload)} of device memory")

        yield judge


@contextmanager
def of_replies(trial: ClientTrial) -> Iterator[Judge]:
    """Of welcome and a reply to each request; the testee must go on, and ask again after the size
    [0,0] and all else, where it does so after plain replies.
    """
    plainly = cache(lambda: asked_after_plain_replies(trial))
    yield lambda writer: judge_replies(trial, writer, plainly())


def judge_replies(trial: ClientTrial, writer: Writer, wanted: Counter[str]) -> bool:
    """The same; it has to ask for so much where that shows that it reads. Whether it was seen to
    have read.
    """
    before, asks_on = trial.controls, wanted[SIZE] == TIMES_AGAIN
    trial.role.server = ODDLY_NAMED
    written: list[bytes] = []
    trial.role.encode["msg"] = noting(writer, written)
    connection = asking(trial)
    answer_all(trial, connection)
    read = wait_for_all(trial, connection, wanted) or not asks_on
    trial.role.encode["msg"] = encode  # long replies would keep both ends too busy to wait
    # Poses go on for a while even if reading does not.
    trial.ends(connection, REACTION_SECONDS)
    outcome = outcome_of_reading(trial, connection)
    last = shorten(written[-1].decode(), 400) if written else ""
    what = f"{len(written)} messages on the message channel, the last {last!r}"
    trial.judge("accepts" if outcome == "ignores" and read else outcome, what)
    return asks_on or trial.controls > before


# Servers

POSES_ON_A_CONNECTION = 10
SAME = ("type", "id", "position", "rotation", "t", "viewport_size")
"""Members of a reply that stay what they are from one time to the next."""
TAGS = ("t", "t" * 64, "7c1f-41", '"\\/\b\f\n\r\t', "\x00\x1f\x7f\u2028", "é中🙂", "🙂" * 64)
PROGRAM = {"name": TAGS[3], "version": TAGS[5]}
"""Whose name is made of what has escapes of its own, or needs several."""
UNKNOWN_TO_1_0: Json = {"id": "", "tag": "", "intrinsics": {}}
"""Whose names 1.1 knows (spec 1.1 chapter 6, NEG-27)."""
REQUESTS_1_1: tuple[Json, ...] = (
    *({**request, "id": number} for number, request in enumerate(REQUESTS)),
    {"type": "get_scene", "id": 0},
    {"type": "ping", "t": 1_700_000_000.25, "id": 9_007_199_254_740_991},
    {"type": "ping", "t": -0.0},
)


def another_answer(said: Json, plainly: Json) -> bool:
    """Whether two replies to the same differ in what stays what it is."""
    return any(said.get(it) != plainly.get(it) for it in SAME)


def _of_1_0(trial: ServerTrial, connection: Connection, message: Json) -> Json:
    unknown = trial.requirement.id == "JSN-7" and not trial.with_(connection).welcome
    return message | (UNKNOWN_TO_1_0 if unknown else {})


@contextmanager
def of_requests(trial: ServerTrial) -> Iterator[Judge]:
    """Of requests, each of which must be answered, once, and as when it is written plainly. A
    client of 1.1 asks in turns with one of 1.0, of the server that knows it.
    """
    plainly: dict[bytes, Json] = {}
    first = trial.dial("msg")
    askers = [(first, tuple(_of_1_0(trial, first, request) for request in REQUESTS))]
    if trial.facts.welcome["msg"] is not None and not trial.facts.alone["msg"]:
        width, height = trial.facts.size
        same: Json = {"type": "set_viewport", "width": width, "height": height, "id": 1}
        sized = (same,) if width and height else ()  # which changes nothing
        askers.append((trial.greeted("msg"), (*REQUESTS_1_1, *sized)))

    def judge(writer: Writer) -> None:
        connection, requests = askers[trial.number % len(askers)]
        request = requests[trial.number // len(askers) % len(requests)]
        payload, plain = writer(request), encode(request)
        if plain not in plainly:
            plainly[plain] = trial.ask(connection, request) or {}
        before = len(connection.messages)
        for script in (payload, encode(VIEWPORT_REQUEST)):
            connection.send(packet(script))
        trial.wait(lambda: len(connection.messages) >= before + 2 or connection.ended)
        taken = len(connection.messages) >= before + 2
        _judge(trial, connection, taken, f"the request {shown(payload)}")
        said = connection.messages[before].value or {}
        if another_answer(said, plainly[plain]):  # or what was asked for has changed meanwhile
            plainly[plain] = trial.ask(connection, request) or {}
        told = f"the request {shown(payload)} is answered by {show(said)}"
        trial.expect(
            not another_answer(said, plainly[plain]),
            "another-answer",
            f"{told}, and written plainly by {show(plainly[plain])}",
        )

    yield judge
    for connection, _ in askers:
        connection.close()


@contextmanager
def of_poses(trial: ServerTrial) -> Iterator[Judge]:
    """Of poses, each of which must be shown by a frame. Of a server of 1.1 half of them have tags,
    and intrinsics where that server grants them.
    """
    steering = CameraControl(trial)

    def judge(writer: Writer) -> None:
        number, poser = trial.number, in_use(trial)
        tags = number // POSES_ON_A_CONNECTION % 2 and trial.facts.welcome["msg"] is not None
        if number and number % POSES_ON_A_CONNECTION == 0:
            poser.close()
            poser = trial.greeted("msg") if tags else trial.dial("msg")
        pose = camera_pose((number % 97 / 4, -1.5, 1e-7), (0.0, 0.6, -0.0, 0.8))
        pose = pose | {"tag": TAGS[number % len(TAGS)]} if tags else _of_1_0(trial, poser, pose)
        if "intrinsics" in trial.with_(poser).granted and trial.facts.size != (0, 0):
            pose |= {"intrinsics": intrinsics(*trial.facts.size)}
        payload = writer(pose)
        trial.judge(steering.takes(poser, pose, payload), f"the pose {shown(payload)}")

    yield judge


def _greeted(trial: ServerTrial) -> tuple[Connection, bool]:
    """A connection on which hello was said, and whether it is welcome. A server may take a while to
    see that the last client has gone, which has said so much, and has no place before.
    """
    until = trial.peer.clock() + EFFECT_SECONDS
    while True:
        connection = trial.before_hello("ipc")
        trial.viewer.greet(connection, client=PROGRAM)
        taken, dealings = trial.is_welcomed(connection), trial.with_(connection)
        if taken and trial.facts.renders:
            trial.grows(connection, dealings.frames)
        if "too_many_clients" not in dealings.errors() or trial.peer.clock() > until:
            return connection, taken
        trial.rest(GONE_SECONDS)


@contextmanager
def of_receipts(trial: ServerTrial) -> Iterator[Judge]:
    """Of hello, opened and release; welcome, memory and frames must follow."""
    trial.greeted("ipc").close()
    poser = trial.dial("msg")

    def judge(writer: Writer) -> None:
        written: list[bytes] = []
        trial.viewer.encode = noting(writer, written)
        connection, taken = _greeted(trial)
        frames = trial.with_(connection).frames
        if taken and trial.facts.renders:
            poser.send(packet(encode(camera_pose(((trial.number + 1) % 97 / 4, 0.0, 0.0)))))
            taken = trial.wait(lambda: len(frames) > 1 or connection.ended)
        taken = taken and not connection.ended
        _judge(trial, connection, taken, f"the message {shown(written[-1])} on the IPC channel")
        trial.viewer.encode = encode
        connection.close()

    yield judge
    poser.close()  # which gives control up


# The checks

ENDS: dict[End, Needs] = {
    CLIENT_IPC: OPENS_HOST_MEMORY,
    CLIENT_DEVICE: DEVICE,
    CLIENT_MSG: ("asks",),
    SERVER_IPC: ("1.1",),
    SERVER_MSG: (),
    SERVER_HOST: ("frames",),
}


def reading(trial: Trial, place: Place) -> AbstractContextManager[Judge]:
    """What judges the reading at this end."""
    if isinstance(trial, ServerTrial):
        by_place = {"ipc": of_receipts, "msg": of_requests, "host": of_poses}
        return by_place[place](trial)
    if place == "device":
        return of_images(trial)
    return of_announcements(trial) if place == "ipc" else of_replies(trial)


def spelled(
    quick: int, full: int, liberties: st.SearchStrategy[list[str]] = MOST_OFTEN_ALL
) -> Cases:
    """Drawn spellings."""
    drawn = st.tuples(SEEDS, liberties)
    return Cases(drawn=drawn, quick=quick, full=full, simpler=with_less)


def with_others(quick: int, full: int) -> Cases:
    """Seeds of unknown members."""
    return Cases([AROUND], SEEDS, quick=quick, full=full)


@check(
    "JSN-6",
    on=ENDS,
    given=reading,
    cases={
        CLIENT_IPC: spelled(40, 4000),
        CLIENT_DEVICE: spelled(5, 300),
        CLIENT_MSG: spelled(6, 30),
        SERVER_IPC: spelled(10, 300, ALL),
        SERVER_MSG: spelled(60, 2000, ALL),
        SERVER_HOST: spelled(30, 1000, ALL),
    },
)
def check_takes_any_spelling(
    trial: Trial, place: Place, judge: Judge, case: Spelling
) -> bool | None:
    """Messages with members in any order, white space between all tokens, escapes in strings and
    names, numbers with fractions, exponents and many digits: welcome, init packets, frames and
    replies; hello, opened, release, requests and poses. Each has its effect.
    """
    return judge(odd_spelling(case))


@check(
    "JSN-7",
    on=ENDS,
    given=reading,
    cases={
        CLIENT_IPC: with_others(40, 4000),
        CLIENT_DEVICE: with_others(4, 300),
        CLIENT_MSG: with_others(2, 30),
        SERVER_IPC: with_others(10, 300),
        SERVER_MSG: with_others(60, 2000),
        SERVER_HOST: with_others(30, 1000),
    },
)
def check_ignores_unknown_members(
    trial: Trial, place: Place, judge: Judge, seed: int
) -> bool | None:
    """The same messages with unknown members at every level: odd names, names from other levels,
    values nested to the limit, a decoy of the message itself; where a server speaks 1.0, what 1.1
    adds, and would refuse.
    """
    return judge(unknown_members(trial, seed))


LENGTHS: tuple[int, ...] = (1 << 12, (1 << 16) + 1, LIMITS["max_payload_bytes"])
"""Of payloads in bytes: beyond what buffers hold that somebody thought large enough; the longest
last, so that what is smaller is known to be taken.
"""


def reading_once(trial: ClientTrial, channel: Place) -> AbstractContextManager[Judge]:
    """The same, but that what is long tells no time of requests: it is under way for a while."""
    if channel == "ipc":
        return of_announcements(trial)
    return nullcontext(partial(judge_replies, trial, wanted=Counter(trial.facts.asks)))


@check(
    "JSN-6",
    on={CLIENT_IPC: OPENS_HOST_MEMORY, CLIENT_MSG: ("asks",)},
    given=reading_once,
    cases=Cases(LENGTHS),
)
def check_takes_any_length(
    trial: ClientTrial, place: Place, judge: Judge, length: int
) -> bool | None:
    """What a client is told, with white space that makes it as long as a payload may be."""
    return judge(of_length(length))


@check(
    "JSN-4",
    on={CLIENT: ("ipc", "msg")},
)
def check_writes_numbers_once_it_has_images(trial: ClientTrial) -> None:
    """The harness plays a server of 1.0 whose init packet is good, and listens for poses: some
    clients send none before they have images.
    """
    trial.role.speaks = "1.0"
    size = trial.role.width, trial.role.height
    with image_of(trial, *size) if trial.device else nullcontext() as image:
        if image is not None:
            trial.role.device_packet = image.init_packet()
        trial.connection("ipc")
        dealings = trial.with_(trial.connection("msg"))
        if not trial.wait(lambda: any(map(dealings.count, POSES))):
            trial.not_observable(
                "the testee sent no pose that can be read after an init packet of 1.0"
            )
        heard = (m for it in trial.peer.conversations() for m in it.sent_by("client"))
        faults = [it for m in heard if m.kind in POSES for it in m.faults]
        wrong = next((it for it in faults if it.requirement == trial.requirement.id), None)
        if wrong:
            trial.violated(wrong.code, f"in a pose after an init packet: {wrong.text}")
