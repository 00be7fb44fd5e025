"""Checks on how servers answer requests (spec 1.0 section 6.2)."""

import itertools
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.exchanges.exchange import in_use
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire import messages
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.message_kinds import CAPABILITIES
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

SAFE: int = LIMITS["max_safe_integer"]
ASKED = 1024
"""Cameras to ask for, to learn how many there are."""
MANY_PACKETS = 1000
"""On one connection; what came later would take long to look through again and again."""
FAR_INDICES = (-1, -2, -3, -1024, -(2**31), 2**31, 2**32, 2**32 + 1, 2**53 - 2, SAFE, -SAFE)
BAD_INDICES: tuple[Any, ...] = (
    *(None, True, "0", "", [], [0], {}, 0.5, -0.5, 1e-9, 1e300, -1e300),
    *(SAFE + 1, -SAFE - 1, 2**63, 2**64, 10**300, float(2**60)),
)
CAMERA_0: Json = {"type": "get_camera_pose", "cam_idx": 0}
UNKNOWN_TYPES: tuple[Any, ...] = (
    *("weather_report", "", " ", "GET_VIEWPORT_SIZE", "get_viewport_size ", "get_viewport", "\x00"),
    *("viewport_size", "welcome", "error", "frame", "init_packet", "t" * 10_000, "🙂", "__class__"),
    *(None, True, 0, 1e308, [], ["get_viewport_size"], {}, {"type": "get_viewport_size"}),
)
REQUESTS = st.lists(st.sampled_from(("size", "camera", "unknown", "pose")), min_size=1, max_size=40)
MESSAGES: dict[str, Json] = {
    "size": VIEWPORT_REQUEST,
    "camera": CAMERA_0,
    "unknown": {"type": "weather_report"},
    "pose": camera_pose(),
}


@check(
    "REQ-6", on={SERVER: ()}, observable="the replies for indices beyond the cameras, and below 0"
)
def check_camera_index_is_taken_modulo(trial: ServerTrial) -> None:
    """A thousand cameras are asked for, which shows after how many they come again; then indices
    that are negative, and as large as they may be.
    """
    first = cameras(trial, range(ASKED))
    period = next((n for n in range(1, ASKED // 2 + 1) if first[n:] == first[:-n]), None)
    if period is None:
        half = first[ASKED // 2 :]
        alike = all(each == half[0] for each in half)
        trial.expect(
            not alike,
            "cameras-alike",
            f"every camera from index {_last_change(first)} to {ASKED - 1} is the same",
        )
        trial.not_observable(f"the scene comes with more than {ASKED // 2} cameras")
    for index in trial.each(FAR_INDICES):
        (told,) = cameras(trial, [index])
        of = f"camera {index % period} of {period}"
        trial.expect(
            told == first[index % period], "another-camera", f"camera {index} is {told}, not {of}"
        )


@check(
    "REQ-7",
    on={SERVER: ()},
    observable="one reply to each request that was sent in one write, in their order",
)
def check_one_reply_each_in_order(trial: ServerTrial) -> None:
    """Requests of both kinds in any order, with poses and unknown messages among them."""
    usual = ["size", "camera", "camera", "size", "pose", "unknown"] * 40
    connection = trial.dial("msg")
    for kinds in trial.each([usual], REQUESTS, quick=30, full=1000):
        if len(connection.messages) > MANY_PACKETS:
            connection.close()
            connection = trial.dial("msg")
        before = len(trial.replies(connection))
        asked = [kind for kind in [*kinds, "size"] if kind in ("size", "camera")]
        connection.send(b"".join(packet(encode(MESSAGES[kind])) for kind in [*kinds, "size"]))
        replies = replies_after(trial, connection, before, len(asked))
        told = ["size" if "viewport_size" in each else "camera" for each in replies]
        trial.expect(
            told == asked,
            "other-replies",
            f"{len(told)} replies ({_few(told)}) to {len(asked)} requests ({_few(asked)})",
        )
        trial.delivered += 1


@check(
    "REQ-7",
    on={SERVER: ()},
    observable="the replies to requests before one that is broken, in one write",
    may_crash=True,
)
def check_answers_what_came_before_a_broken_request(trial: ServerTrial) -> None:
    """Good requests and then a broken one, for which the connection may be closed (REQ-9)."""
    for count in trial.each((1, 2, 50)):
        connection = trial.dial("msg")
        good = [(VIEWPORT_REQUEST, CAMERA_0)[number % 2] for number in range(count)]
        broken = CAMERA_0 | {"cam_idx": "0"}
        connection.send(b"".join(packet(encode(each)) for each in (*good, broken)))
        told = replies_after(trial, connection, 0, count)
        what = f"{count} requests and a broken one behind them"
        trial.expect(len(told) == count, "wrong-count", f"{len(told)} replies to {what}")
        connection.close()
        trial.delivered += 1


UNKNOWN: tuple[Json, ...] = (
    *({"type": kind} for kind in UNKNOWN_TYPES),
    *({}, {"Type": "get_viewport_size"}, {"cam_idx": 0}),
    *(camera_pose() | {"type": kind} for kind in ("pose", "Camera_Pose", None, ["camera_pose"])),
    *(CAMERA_0 | {"type": kind} for kind in ("camera", None, ["get_camera_pose"])),
    {"viewport_size": [64, 48], "type": None},
    {name: value for name, value in camera_pose().items() if name != "type"},
)


@check(
    "REQ-8",
    on={SERVER: ()},
    observable="no reply, and the connection goes on",
    cases=Cases(UNKNOWN),
    may_crash=True,
)
def check_unknown_messages_are_ignored(trial: ServerTrial, message: Json) -> None:
    """Types that nobody knows, or that are no strings, and messages without any."""
    outcome = trial.outcome_on_msg(in_use(trial), packet(encode(message)))
    trial.judge(outcome, f"the message {shorten(str(message))}")


@check("REQ-8", on={SERVER: ()}, observable="no reply, and the connection goes on", may_crash=True)
def check_hello_is_nothing_to_1_0(trial: ServerTrial) -> None:
    """The `hello` of a client of 1.1, where the server speaks 1.0 alone."""
    if trial.facts.version() != "1.0":
        trial.not_observable("the server knows hello")
    hello = packet(encode(messages.hello([*CAPABILITIES["msg"]], None)))
    trial.judge(trial.outcome_on_msg(in_use(trial), hello), "a hello")
    trial.delivered += 1


@check(
    "REQ-9",
    on={SERVER: ()},
    observable="no reply; the connection is closed or goes on",
    may_crash=True,
)
def check_broken_requests_have_no_reply(trial: ServerTrial) -> None:
    """Requests for a camera without an index, or with one that is no integer or out of range, of a
    client of 1.0, and of one of 1.1 that gives them ids; an `error` is no reply (1.1 section 2.6).
    """
    messages = [CAMERA_0 | {"cam_idx": index} for index in BAD_INDICES]
    messages += [{"type": "get_camera_pose"}, {"type": "get_camera_pose", "camIdx": 0}]
    versions = (False, True) if trial.facts.welcome["msg"] is not None else (False,)
    connections: dict[bool, Connection] = {}
    for greets, message in trial.each(list(itertools.product(versions, messages))):
        connection = connections.get(greets)
        if connection is None or connection.ended:
            for each in connections.values():
                each.close()
            connection = trial.greeted("msg") if greets else trial.dial("msg")
            connections = {greets: connection}
        asked = message | {"id": 7} if greets else message
        outcome = trial.outcome_on_msg(connection, packet(encode(asked)))
        reported = greets and outcome == "reports"
        what = f"the request {shorten(str(asked))}"
        trial.judge("ignores" if reported else outcome, what)


@check(
    "REQ-10",
    on={SERVER: ()},
    observable="replies come while nobody reads images; a server that renders all the time and "
    "holds each reply until its next image is not seen to",
)
def check_replies_do_not_wait_for_an_image(trial: ServerTrial) -> None:
    """A pose and requests of every kind, from a client that is the only one: no image is due for
    anybody.
    """
    connection = trial.dial("msg")
    if trial.facts.welcome["msg"] is not None:
        connection.close()
        connection = trial.greeted("msg")
    trial.rest(REACTION_SECONDS)
    for number in trial.each(range(3)):
        trial.viewer.say(connection, camera_pose((float(number), 0.0, 0.0)))
        for request in every_request(trial, connection):
            if request["type"] != "set_viewport":  # a size is had when there is memory of it
                told = trial.ask(connection, request)
                trial.expect(
                    told is not None, "no-reply", f"no reply to {request} without an image"
                )
                trial.delivered += (told or {}).get("type") != "error"


def every_request(trial: ServerTrial, connection: Connection) -> list[Json]:
    """A good request of each kind that this connection may send."""
    granted = trial.viewer.with_(connection).granted
    width, height = trial.facts.size
    by_capability: dict[str, Json] = {
        "scene": {"type": "get_scene"},
        "ping": {"type": "ping", "t": 12.5},
        "viewport": {"type": "set_viewport", "width": width, "height": height},
    }
    agreed = [request for name, request in by_capability.items() if name in granted]
    return [VIEWPORT_REQUEST, CAMERA_0, *(it for it in agreed if it.get("width") != 0)]


def replies_after(
    trial: ServerTrial, connection: Connection, before: int, count: int
) -> list[Json]:
    """What was answered past so many replies, once so many more have come, or none for a while."""

    def another(came: int) -> bool:
        trial.wait(lambda: len(trial.replies(connection)) > came or connection.ended)
        return len(trial.replies(connection)) > came

    while (came := len(trial.replies(connection))) < before + count and another(came):
        pass
    return trial.replies(connection)[before:]


def cameras(trial: ServerTrial, indices: range | list[int]) -> list[Json]:
    """The replies for these cameras; the requirement is violated if one does not come."""
    connection = trial.dial("msg")
    requests = [packet(encode(CAMERA_0 | {"cam_idx": index})) for index in indices]
    connection.send(b"".join(requests))
    told = replies_after(trial, connection, 0, len(requests))
    asked = f"{len(requests)} requests for a camera, from {indices[0]} to {indices[-1]}"
    trial.expect(len(told) >= len(requests), "no-reply", f"{len(told)} replies to {asked}")
    other = [each for each in told if "position" not in each]
    trial.expect(
        not other,
        "another-answer",
        f"the reply to one of {asked} tells of no camera: {show(other[:1])}",
    )
    connection.close()
    trial.delivered += len(requests)
    return told


def _last_change(replies: list[Json]) -> int:
    return 1 + max((n for n in range(len(replies) - 1) if replies[n] != replies[n + 1]), default=-1)


def _few(kinds: list[str]) -> str:
    return ", ".join(kinds[:12]) + (", …" if len(kinds) > 12 else "")
