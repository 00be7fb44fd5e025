"""Checks on what a client understands of replies (spec 1.0 chapters 6 to 8)."""

from collections.abc import Iterator
from typing import Any, TypeVar

from hypothesis import strategies as st

from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.cases.valid.numbers import hard_numbers
from splatbus_conformance.cases.valid.poses import Pose, poses
from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.odd_replies import OddReplies
from splatbus_conformance.trials.moves.pose_error import (
    PoseError,
    engine_of,
    misread,
    rotation_budget,
    why,
)
from splatbus_conformance.trials.testee.adapter import AdapterBroken, Declined
from splatbus_conformance.trials.testee.adapter_smoke import GIVING_UP_SECONDS
from splatbus_conformance.wire.messages import Json

TOGETHER = 8
"""Cameras that are asked for at once."""
NEXT_SECONDS = 0.05
"""A client that asks for more before it waits does so within this time."""
OWN_SECONDS = 0.3
"""For what the client asks by itself."""
CAMERAS = [
    Pose((float(n), -2.0 * n, 0.5 * n), (0.0, 0.6, 0.0, 0.8) if n % 2 else (0.8, 0.0, 0.0, 0.6))
    for n in range(1, 1 + TOGETHER)
]
REQUESTS = st.lists(
    st.one_of(
        st.just("viewport_size"),
        st.integers(-TOGETHER, 2 * TOGETHER - 1).map(lambda index: {"camera": index}),
    ),
    min_size=2,
    max_size=TOGETHER,
)
OBSERVABLE = "the replies, as the client understood them, told by the adapter"


T = TypeVar("T")


def fewer(case: list[T]) -> list[list[T]]:
    """Shorter lists, but not the empty one."""
    return [shorter for shorter in without_one(case) if shorter]


def asked(trial: ClientTrial, answering: OddReplies, requests: list[Any]) -> list[Json]:
    """What the client made of the replies to these requests."""
    answering.ask(requests)
    return made_of_replies(trial, answering, requests)


def made_of_replies(trial: ClientTrial, answering: OddReplies, requests: list[Any]) -> list[Json]:
    """The same, of requests that it was told to make. One that was sent every reply, and yet waits
    for one until it closes, breaks REQ-11; other checks can say nothing then.
    """
    try:
        replies: list[Json] = trial.take("ask")["replies"]
    except Declined as problem:
        if answering.waiting or not trial.wait(trial.role.is_given_up, GIVING_UP_SECONDS):
            raise
        untaken = (
            f"its requests were answered, and it waited for a reply until it closed: {problem}"
        )
        if trial.requirement.id == "REQ-11":
            trial.violated("reply-not-taken", untaken)
        trial.not_observable(f"{untaken} (REQ-11)")
    if len(replies) != len(requests):
        raise AdapterBroken(f"asked for {len(requests)} replies, it told {len(replies)}")
    return replies


def understood(
    trial: ClientTrial, answering: OddReplies, index: int, reply: Json
) -> tuple[Pose, PoseError]:
    """The pose on the wire that the client made this of, and how far it is off."""
    engine = engine_of(trial.greeting, "camera_pose")
    if "position" not in reply:
        trial.violated("not-a-pose", f"the reply to get_camera_pose was taken for {reply}")
    got = Pose(tuple(reply["position"]), tuple(reply["rotation"]))
    size = trial.role.width, trial.role.height

    def error(wire: Pose) -> PoseError:
        return misread(got, wire, engine, single=trial.greeting.single, size=size)

    found = ((wire, error(wire)) for wire in answering.possible(index))
    # Of two that are as near, such as of which one number is tiny, the worst number tells.
    return min(found, key=lambda it: (it[1].angle + it[1].distance, it[1].position))


@check("REQ-11", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:ask")})
def check_matches_replies_by_their_order(trial: ClientTrial) -> None:
    """Requests of both kinds, as many at a time as the client sends before it waits; each camera
    has another pose, and the replies come in order, all at once.
    """
    answering = OddReplies(trial)
    answering.cameras = CAMERAS
    trial.connection("msg")
    trial.rest(OWN_SECONDS)
    for requests in trial.each(drawn=REQUESTS, quick=15, full=60, simpler=fewer):
        answering.holds = True
        answering.ask(requests)
        _gather(trial, answering, len(requests))
        answering.answer_all()
        replies = made_of_replies(trial, answering, requests)
        for number, (request, reply) in enumerate(zip(requests, replies, strict=True), 1):
            if not _answers(trial, answering, request, reply):
                told = f"of {requests} number {number}, {request}, was given {reply}"
                trial.violated("another-reply", f"{told}: the reply to another")
        trial.delivered += 1


def _gather(trial: ClientTrial, answering: OddReplies, most: int) -> None:
    """Wait for requests for as long as more of them come."""
    known = len(answering.waiting)
    if known < most and trial.wait(lambda: len(answering.waiting) > known, NEXT_SECONDS):
        _gather(trial, answering, most)


def _answers(trial: ClientTrial, answering: OddReplies, request: Any, reply: Json) -> bool:
    if request == "viewport_size":
        size = reply.get("width"), reply.get("height")
        return size == (trial.role.width, trial.role.height)
    if "position" not in reply:
        return False
    return not understood(trial, answering, request["camera"], reply)[1].far


def replied(trial: ClientTrial, quick: int, full: int) -> Iterator[tuple[Pose, Json, PoseError]]:
    """Poses on the wire, in replies, and what the client made of each."""
    answering = OddReplies(trial)
    trial.connection("msg")
    search = f"{trial.requirement.id} replies"
    pose = poses(search, single=trial.greeting.single).map(Pose.as_lists)
    together = st.lists(pose, min_size=TOGETHER, max_size=TOGETHER)
    for case in trial.each(drawn=together, quick=quick, full=full, simpler=fewer, search=search):
        answering.cameras = [Pose.of(camera) for camera in case]
        requests = [{"camera": index} for index in range(len(answering.cameras))]
        for index, reply in enumerate(asked(trial, answering, requests)):
            trial.delivered += index in answering.told
            wire, found = understood(trial, answering, index, reply)
            yield wire, reply, found


@check("CNV-1", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:ask")})
def check_understands_cameras(trial: ClientTrial) -> None:
    """Poses in replies to `get_camera_pose`, near every edge of what is allowed."""
    for wire, reply, found in replied(trial, 6, 100):
        if found.far:
            taken = Pose(tuple(reply["position"]), tuple(reply["rotation"]))
            engine = engine_of(trial.greeting, "camera_pose")
            reason = why(wire, taken, engine, "in") or f"it is {found.away_by} away"
            trial.violated("another-pose", f"the camera {wire} was taken for {reply}: {reason}")


@check("ACC-7", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:ask")})
def check_axes_change_exactly_on_the_way_in(trial: ClientTrial) -> None:
    """Poses in replies, from the wire's axes to the engine's: positions exact, or within half an
    ULP where they are scaled; quaternions within 4u.
    """
    engine = engine_of(trial.greeting, "camera_pose")
    quaternions = rotation_budget(trial.greeting, "camera_pose")
    for wire, _, found in replied(trial, 6, 100):
        words = str(wire)
        trial.measured("position", found.position, float(engine.scale != 1) / 2, "ULP", words)
        trial.measured("quaternion", found.rotation, quaternions, "u", words)
        trial.measured("angle", found.angle, None, "rad", words)
    trial.expect_within_budgets()


@check("ACC-14", observable=OBSERVABLE, on={CLIENT: ("msg", "adapter:ask")})
def check_numbers_are_read_to_the_last_bit(trial: ClientTrial) -> None:
    """Cameras whose positions are decimals next to halfway between two doubles, exact, and of 17
    digits; where the engine scales positions or holds them in single precision, after that.
    """
    answering = OddReplies(trial)
    trial.connection("msg")
    budget = 0.0 if engine_of(trial.greeting, "camera_pose").scale == 1 else 1.0
    numbers = st.tuples(hard_numbers(), hard_numbers(), hard_numbers())
    for texts in trial.each(drawn=numbers, quick=40, full=1000, search="ACC-14"):
        answering.position = texts
        (reply,) = asked(trial, answering, [{"camera": 0}])
        _, found = understood(trial, answering, 0, reply)
        trial.measured("position", found.position, budget, "ULP", f"({', '.join(texts)})")
        trial.delivered += 0 in answering.told
    trial.expect_within_budgets()
