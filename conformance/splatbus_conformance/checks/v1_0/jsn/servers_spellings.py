"""Checks on how servers take other spellings, and unknown members (spec 1.0 section 2.2)."""

from collections.abc import Callable
from random import Random

from hypothesis import strategies as st

from splatbus_conformance.cases.valid.spelling import spell
from splatbus_conformance.cases.valid.unknown_members import with_unknown_members
from splatbus_conformance.checks import check
from splatbus_conformance.checks.v1_0.jsn.servers import REQUESTS, shown
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_reading import read
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import Json, camera_pose, encode, intrinsics
from splatbus_conformance.wire.packets import packet

Writer = Callable[[Json, Random], bytes]
SEEDS = st.integers(0, 2**32 - 1)
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


def odd_spelling(message: Json, random: Random) -> bytes:
    """The message, spelled as RFC 8259 allows."""
    return spell(message, random).encode()


def unknown_members(message: Json, random: Random) -> bytes:
    """The message with members that nobody knows."""
    return encode(with_unknown_members(message, random))


def judge_writer_of_requests(trial: ServerTrial, writer: Writer, quick: int, full: int) -> None:
    """Write requests so; each must be answered, once, and as when it is written plainly. A client
    of 1.1 asks in turns with one of 1.0, of the server that knows it.
    """
    plainly: dict[bytes, Json] = {}
    asking = [(trial.dial("msg"), REQUESTS)]
    if trial.facts.welcome["msg"] is not None and not trial.facts.alone["msg"]:
        width, height = trial.facts.size
        same: Json = {"type": "set_viewport", "width": width, "height": height, "id": 1}
        sized = (same,) if width and height else ()  # which changes nothing
        asking.append((trial.greeted("msg"), (*REQUESTS_1_1, *sized)))
    for number, seed in enumerate(trial.each(drawn=SEEDS, quick=quick, full=full)):
        connection, requests = asking[number % len(asking)]
        request = requests[number // len(asking) % len(requests)]
        payload, plain = writer(request, Random(seed)), encode(request)
        packets = len(connection.packets)
        for script in (payload, encode(VIEWPORT_REQUEST)):
            connection.send(packet(script))
        trial.wait(lambda: len(connection.packets) >= packets + 2 or connection.ended)  # noqa: B023
        taken = len(connection.packets) >= packets + 2
        closed = "closes" if connection.ended else "ignores"
        trial.judge("accepts" if taken else trial.fate() or closed, f"the request {shown(payload)}")
        if plain not in plainly:
            plainly[plain] = trial.ask(connection, request) or {}
        said = read(connection.packets[packets].payload).value or {}
        differs = [it for it in SAME if said.get(it) != plainly[plain].get(it)]
        told = f"the request {shown(payload)} is answered by {show(said)}"
        trial.expect(
            not differs, "another-answer", f"{told}, and written plainly by {show(plainly[plain])}"
        )
        trial.delivered += 1


def judge_writer_of_poses(trial: ServerTrial, writer: Writer, quick: int, full: int) -> None:
    """Write poses so; each must be shown by a frame. Of a server of 1.1 half of them have tags, and
    intrinsics where that server grants them.
    """
    steering, poser = CameraControl(trial), trial.dial("msg")
    for number, seed in enumerate(trial.each(drawn=SEEDS, quick=quick, full=full)):
        pose = camera_pose((number % 97 / 4, -1.5, 1e-7), (0.0, 0.6, -0.0, 0.8))
        tags = number // POSES_ON_A_CONNECTION % 2 and trial.facts.welcome["msg"] is not None
        if number and number % POSES_ON_A_CONNECTION == 0:
            poser.close()
            poser = trial.greeted("msg") if tags else trial.dial("msg")
        pose |= {"tag": TAGS[number % len(TAGS)]} if tags else {}
        if "intrinsics" in trial.viewer.with_(poser).granted and trial.facts.size != (0, 0):
            pose |= {"intrinsics": intrinsics(*trial.facts.size)}
        payload = writer(pose, Random(seed))
        trial.judge(steering.takes(poser, pose, payload), f"the pose {shown(payload)}")


def judge_writer_on_ipc(trial: ServerTrial, writer: Writer, quick: int, full: int) -> None:
    """Write hello, opened and release so; welcome, memory and frames must follow."""
    trial.greeted("ipc").close()
    poser, nudges = trial.dial("msg"), 0
    for seed in trial.each(drawn=SEEDS, quick=quick, full=full):
        random, written = Random(seed), list[bytes]()

        def encode_and_keep(message: Json) -> bytes:
            written.append(writer(message, random))  # noqa: B023 - the closures end with the round
            return written[-1]  # noqa: B023

        connection = trial.before_hello("ipc")
        dealings = trial.viewer.with_(connection)
        trial.viewer.encode = encode_and_keep
        trial.viewer.greet(connection, client=CLIENT)
        taken = trial.wait(lambda: dealings.welcome or connection.ended)  # noqa: B023
        if dealings.welcome and trial.facts.renders:
            trial.wait(lambda: dealings.frames or connection.ended)  # noqa: B023
            nudges += 1
            pose = camera_pose((nudges % 97 / 4, 0.0, 0.0))
            poser.send(packet(encode(pose)))
            taken = trial.wait(lambda: len(dealings.frames) > 1 or connection.ended)  # noqa: B023
        closed = "closes" if connection.ended else "ignores"
        outcome = "accepts" if taken and not connection.ended else trial.fate() or closed
        trial.judge(outcome, f"the message {shown(written[-1])} on the IPC channel")
        trial.viewer.encode = encode
        connection.close()
        trial.delivered += 1


@check("JSN-6", observable="the server answers requests that are spelled so")
def check_takes_any_spelling_of_requests(trial: ServerTrial) -> None:
    """Requests with members in any order, white space between all tokens, escapes in strings and
    names, numbers with fractions, exponents and many digits.
    """
    judge_writer_of_requests(trial, odd_spelling, quick=60, full=2000)


@check(
    "JSN-6", observable="a frame shows the camera of a pose that is spelled so", needs=("frames",)
)
def check_takes_any_spelling_of_poses(trial: ServerTrial) -> None:
    """The same of poses."""
    judge_writer_of_poses(trial, odd_spelling, quick=30, full=1000)


@check("JSN-6", observable="welcome and frames follow what is spelled so", needs=("1.1",))
def check_takes_any_spelling_on_ipc(trial: ServerTrial) -> None:
    """The same of hello, opened and release."""
    judge_writer_on_ipc(trial, odd_spelling, quick=10, full=300)


@check("JSN-7", observable="the server answers requests that have such members")
def check_ignores_unknown_members_of_requests(trial: ServerTrial) -> None:
    """Requests with unknown members: odd names, values nested to the limit, a decoy of the request
    itself.
    """
    judge_writer_of_requests(trial, unknown_members, quick=60, full=2000)


@check(
    "JSN-7",
    observable="a frame shows the camera of a pose that has such members",
    needs=("frames",),
)
def check_ignores_unknown_members_of_poses(trial: ServerTrial) -> None:
    """The same of poses, at every level."""
    judge_writer_of_poses(trial, unknown_members, quick=30, full=1000)


@check("JSN-7", observable="welcome and frames follow what has such members", needs=("1.1",))
def check_ignores_unknown_members_on_ipc(trial: ServerTrial) -> None:
    """The same of hello, opened and release, at every level."""
    judge_writer_on_ipc(trial, unknown_members, quick=10, full=300)
