"""Every rule on poses, kept and broken."""

import pytest
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    CAMERA,
    POSE,
    SIZE,
    Case,
    breaches,
    changed,
    client,
    first_breach,
    server,
    talk,
)

CLOUD = {**POSE, "type": "point_cloud_pose"}


def sends(*messages: dict | bytes) -> list[Entry]:
    return talk("msg", *(client(message) for message in messages))


W_FIRST = {**POSE, "rotation": {"w": 0.8, "x": 0.0, "y": 0.6, "z": 0.0}}
KEPT = sends(POSE, CLOUD)

CASES = [
    Case("POS-1", "client", KEPT, sends(changed(POSE, "/rotation/w"))),
    Case("POS-2", "client", KEPT, sends(changed(POSE, "/position/z", 3.5e38))),
    Case("POS-3", "client", KEPT, sends(changed(POSE, "/rotation/w", 0.9))),
    Case("POS-4", "client", KEPT, sends(W_FIRST)),
    Case("POS-8", "client", KEPT, sends(changed(POSE, "/timestamp", "noon"))),
    Case("POS-9", "client", KEPT, sends(POSE, changed(POSE, "/timestamp", 12.4))),
]


@pytest.mark.parametrize("norm", [0.0, 0.989, 1.011, 2.0, 1e200])
def test_a_rotation_off_the_unit_sphere_breaks_pos_3_alone(norm: float) -> None:
    rotation = {"x": 0.0, "y": 0.0, "z": 0.0, "w": norm}
    assert breaches(sends({**POSE, "rotation": rotation})) == {("client", "POS-3"): 1}


@pytest.mark.parametrize("norm", [0.9901, 1.0, 1.0099, -1.0])
def test_a_rotation_near_the_unit_sphere_breaks_nothing(norm: float) -> None:
    rotation = {"x": 0.0, "y": 0.0, "z": 0.0, "w": norm}
    assert breaches(sends({**POSE, "rotation": rotation})) == {}


def test_numbers_as_strings_break_jsn_4_alone_and_once_a_message() -> None:
    as_text = {**POSE, "position": {"x": "1.0", "y": "-2e0", "z": "5"}, "timestamp": "12.5"}
    assert breaches(sends(as_text, as_text)) == {("client", "JSN-4"): 2}
    assert first_breach(sends(as_text)).pointer == "/timestamp"


def test_a_string_is_judged_as_the_number_that_it_spells() -> None:
    far = changed(POSE, "/position/x", "1e39")
    assert breaches(sends(far)) == {("client", "JSN-4"): 1, ("client", "POS-2"): 1}


@pytest.mark.parametrize("spelling", [b"NaN", b"-Infinity", b"1e400", b'"1e400"'])
def test_a_number_that_is_not_finite_breaks_jsn_4_alone(spelling: bytes) -> None:
    for part in ("position", "rotation"):
        payload = sends(changed(POSE, f"/{part}/x", 4.125))[1].data
        assert payload is not None
        broken = payload[4:].replace(b"4.125", spelling)
        assert breaches(sends(broken)) == {("client", "JSN-4"): 1}


def test_a_clock_that_was_set_back_is_one_breach() -> None:
    stamps = [10.0, 11.0, 5.0, 6.0, 7.0]
    poses = [changed(POSE, "/timestamp", stamp) for stamp in stamps]
    assert breaches(sends(*poses)) == {("client", "POS-9"): 1}


def test_requests_carry_timestamps_too() -> None:
    asks = {**ASK_CAMERA, "timestamp": None}
    assert breaches(sends(asks)) == {("client", "POS-8"): 1}


def test_other_members_and_their_order_break_nothing() -> None:
    odd = {"rotation": {**POSE["rotation"], "unit": "q"}, "x": [], **POSE}
    assert breaches(sends(odd)) == {}


def test_a_client_s_rules_do_not_judge_what_a_server_sends() -> None:
    strange = talk("msg", server({"type": "camera_pose"}), server(SIZE), server(CAMERA))
    assert not any(peer == "client" for peer, _ in breaches(strange))
