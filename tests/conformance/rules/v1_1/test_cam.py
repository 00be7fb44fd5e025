"""Every rule on cameras, kept and broken."""

from typing import Any

import pytest
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    CAMERA,
    HOST_INIT,
    INTRINSICS,
    POSE,
    Case,
    Step,
    about_generation,
    breaches,
    changed,
    client,
    error,
    frame,
    greeting,
    joined,
    seen,
    server,
    session,
    talk,
)

LENS = {**POSE, "intrinsics": INTRINSICS}
TAGGED = {**POSE, "tag": "7c1f-41"}
OWN = {**INTRINSICS, "width": 64, "height": 48}
REPLY = {"type": "camera", **CAMERA, "intrinsics": OWN}
RELEASED = client(about_generation("release", seq=1))
FIRST = (server(frame(1)), RELEASED)


def msg(*steps: Step, start: float = 1.0) -> list[Entry]:
    return talk("msg", *greeting("intrinsics"), *steps, start=start)


def poses(message: dict) -> list[Entry]:
    return msg(client(message))


def answered(reply: dict, *, granted: bool = True) -> list[Entry]:
    greeted = greeting(*["intrinsics"] * granted)
    memory = talk("ipc", *greeting("host_shm"), server(HOST_INIT), start=0.5)
    return joined(memory, talk("msg", *greeted, client(ASK_CAMERA), server(reply)))


def shown(tag: Any = ..., pose: dict = TAGGED, seq: int = 2) -> Step:
    """A frame from where a pose put the camera."""
    at = {name: list(pose[name].values()) for name in ("position", "rotation")}
    named = {} if tag is ... else {"tag": tag}
    message = frame(seq)
    return server({**message, "camera": {**message["camera"], **at, **named}}, pause=1.0)


def after(poses: list[Entry], *frames: Step) -> list[Entry]:
    return joined(poses, session(*FIRST, *frames))


TWICE = (shown("7c1f-41"), client(about_generation("release", seq=2)), shown("7c1f-41", seq=3))
CASES = [
    Case("CAM-1", "client", poses(TAGGED), poses({**POSE, "tag": ""})),
    Case("CAM-4", "client", poses(LENS), poses(changed(LENS, "/intrinsics/fx", 0))),
    Case("CAM-4", "server", answered(REPLY), answered(changed(REPLY, "/intrinsics/cx"))),
    Case("CAM-8", "server", answered(REPLY), answered(changed(REPLY, "/intrinsics"))),
    Case("CAM-2", "server", after(poses(TAGGED), shown("7c1f-41")), after(poses(TAGGED), shown())),
    Case("CAM-3", "server", after(poses(TAGGED), shown("7c1f-41")), after(poses(TAGGED), *TWICE)),
]


@pytest.mark.parametrize("number", ["2", "1e3"])
def test_a_number_as_a_string_breaks_jsn_4_where_intrinsics_were_agreed(number: str) -> None:
    written = changed(LENS, "/intrinsics/cx", number)
    assert breaches(poses(written)) == {("client", "JSN-4"): 1}
    assert breaches(talk("msg", client(written))) == {}


def test_what_1_0_does_not_know_is_not_judged_there() -> None:
    own = {**POSE, "tag": 7, "intrinsics": "mine"}
    assert breaches(talk("msg", client(own))) == {}


def test_cam_8_wants_the_size_of_the_images() -> None:
    broken = answered(changed(REPLY, "/intrinsics/width", 65))
    assert breaches(broken) == {("server", "CAM-8"): 1}


def test_cam_8_waits_until_the_size_is_known() -> None:
    plain = changed(REPLY, "/intrinsics")
    assert breaches(msg(client(ASK_CAMERA), server(plain))) == {}


def test_cam_8_asks_for_nothing_where_intrinsics_were_not_agreed() -> None:
    plain = changed(REPLY, "/intrinsics")
    assert breaches(answered(plain, granted=False)) == {}
    assert breaches(answered(REPLY, granted=False)) == {}


def test_a_tag_of_nobody_known_may_be_of_a_client_that_was_not_recorded() -> None:
    assert (
        breaches(after(poses(TAGGED), shown("other", pose=changed(POSE, "/position/x", 9)))) == {}
    )


def test_a_tag_before_its_pose_is_that_of_a_pose_before_the_recording() -> None:
    early = joined(msg(client(TAGGED), start=9.0), session(*FIRST, shown("7c1f-41")))
    assert breaches(early) == {}


def test_two_poses_with_one_tag_are_two() -> None:
    moved = changed(TAGGED, "/position/x", 2.0)
    both = (shown("7c1f-41"), client(about_generation("release", seq=2)))
    again = shown("7c1f-41", pose=moved, seq=3)
    assert breaches(after(msg(client(TAGGED), client(moved)), *both, again)) == {}


@pytest.mark.parametrize(
    "sent",
    [
        msg(client(TAGGED), client(POSE)),
        msg(client(TAGGED), server(error("busy"))),
        msg(client(POSE)),
    ],
    ids=["the same pose without a tag", "another client has control", "no tag at all"],
)
def test_cam_2_is_judged_only_where_it_is_certain(sent: list[Entry]) -> None:
    found = after(sent, shown())
    assert breaches(found) == {}
    assert ("server", "CAM-2") not in seen(found)


def test_cam_2_forgives_the_first_image_which_may_be_older_than_the_pose() -> None:
    assert breaches(joined(poses(TAGGED), session(shown(seq=1)))) == {}


def test_cam_2_wants_that_tag() -> None:
    other = after(poses(TAGGED), shown("other"))
    assert breaches(other) == {("server", "CAM-2"): 1}
