"""Whether a server reads what a writer writes (spec 1.0 section 2.2)."""

from collections.abc import Iterator
from contextlib import contextmanager

from splatbus_conformance.checks.v1_0.jsn.clients_spellings import Judge
from splatbus_conformance.checks.v1_0.jsn.servers import REQUESTS, shown
from splatbus_conformance.checks.v1_0.jsn.writers import Writer, noting
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.moves.exchanges.exchange import in_use
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import GONE_SECONDS
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import Json, camera_pose, encode, intrinsics
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

POSES_ON_A_CONNECTION = 10
SAME = ("type", "id", "position", "rotation", "t", "viewport_size")
"""Members of a reply that stay what they are from one time to the next."""
TAGS = ("t", "t" * 64, "7c1f-41", '"\\/\b\f\n\r\t', "\x00\x1f\x7f\u2028", "é中🙂", "🙂" * 64)
CLIENT = {"name": TAGS[3], "version": TAGS[5]}
"""Whose name is made of what has escapes of its own, or needs several."""
REQUESTS_1_1: tuple[Json, ...] = (
    *({**request, "id": number} for number, request in enumerate(REQUESTS)),
    {"type": "get_scene", "id": 0},
    {"type": "ping", "t": 1_700_000_000.25, "id": 9_007_199_254_740_991},
    {"type": "ping", "t": -0.0},
)


def another_answer(said: Json, plainly: Json) -> bool:
    """Whether two replies to the same differ in what stays what it is."""
    return any(said.get(it) != plainly.get(it) for it in SAME)


@contextmanager
def of_requests(trial: ServerTrial) -> Iterator[Judge]:
    """Of requests, each of which must be answered, once, and as when it is written plainly. A
    client of 1.1 asks in turns with one of 1.0, of the server that knows it.
    """
    plainly: dict[bytes, Json] = {}
    asking = [(trial.dial("msg"), REQUESTS)]
    if trial.facts.welcome["msg"] is not None and not trial.facts.alone["msg"]:
        width, height = trial.facts.size
        same: Json = {"type": "set_viewport", "width": width, "height": height, "id": 1}
        sized = (same,) if width and height else ()  # which changes nothing
        asking.append((trial.greeted("msg"), (*REQUESTS_1_1, *sized)))

    def judge(writer: Writer) -> None:
        connection, requests = asking[trial.number % len(asking)]
        request = requests[trial.number // len(asking) % len(requests)]
        payload, plain = writer(request), encode(request)
        if plain not in plainly:
            plainly[plain] = trial.ask(connection, request) or {}
        before = len(connection.messages)
        for script in (payload, encode(VIEWPORT_REQUEST)):
            connection.send(packet(script))
        trial.wait(lambda: len(connection.messages) >= before + 2 or connection.ended)
        taken = len(connection.messages) >= before + 2
        closed = "closes" if connection.ended else "ignores"
        trial.judge("accepts" if taken else trial.fate() or closed, f"the request {shown(payload)}")
        said = connection.messages[before].value or {}
        if another_answer(said, plainly[plain]):  # or what was asked for has changed meanwhile
            plainly[plain] = trial.ask(connection, request) or {}
        told = f"the request {shown(payload)} is answered by {show(said)}"
        trial.expect(
            not another_answer(said, plainly[plain]),
            "another-answer",
            f"{told}, and written plainly by {show(plainly[plain])}",
        )
        trial.delivered += 1

    yield judge


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
        pose |= {"tag": TAGS[number % len(TAGS)]} if tags else {}
        if "intrinsics" in trial.viewer.with_(poser).granted and trial.facts.size != (0, 0):
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
        trial.viewer.greet(connection, client=CLIENT)
        taken, dealings = trial.is_welcomed(connection), trial.viewer.with_(connection)
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
        frames = trial.viewer.with_(connection).frames
        if taken and trial.facts.renders:
            poser.send(packet(encode(camera_pose(((trial.number + 1) % 97 / 4, 0.0, 0.0)))))
            taken = trial.wait(lambda: len(frames) > 1 or connection.ended)
        closed = "closes" if connection.ended else "ignores"
        outcome = "accepts" if taken and not connection.ended else trial.fate() or closed
        trial.judge(outcome, f"the message {shown(written[-1])} on the IPC channel")
        trial.viewer.encode = encode
        connection.close()
        trial.delivered += 1

    yield judge
    poser.close()  # which gives control up
