"""All rules together: each is kept and broken somewhere, none fails, none blames the wrong side."""

import json
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from splatbus_conformance.observe.audit import audit
from splatbus_conformance.rules import all_rules, sightings
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Direction, Entry
from splatbus_schemas.requirements import requirements

from tests.conformance.rules.talk import (
    ADDED,
    ALL,
    ALL_MSG,
    ASK_CAMERA,
    ASK_SIZE,
    CAMERA,
    CUDA_INIT,
    HOST_INIT,
    INIT,
    INTRINSICS,
    OBJECT_POSE,
    PONG,
    POSE,
    SCENE,
    SIZE,
    TELEMETRY,
    Case,
    about_generation,
    breaches,
    check,
    client,
    error,
    frame,
    hello,
    raw,
    server,
    talk,
    welcome,
)

MODULES = sorted(Path(__file__).parent.glob("v1_*/test_*.py"))
ONLY_WITH_THE_OTHER_SIDE_AT_FAULT = {("server", "REQ-8"), ("server", "REQ-9"), ("client", "OPN-6")}
ONLY_SEEN_BROKEN = {("server", "CHN-5"), ("server", "JSN-8"), ("client", "JSN-8")}


@cache
def cases() -> list[Case]:
    modules = [import_module(f"{__package__}.{it.parent.name}.{it.stem}") for it in MODULES]
    return [case for module in modules for case in module.CASES]


@pytest.mark.parametrize("case", cases(), ids=lambda case: f"{case.requirement}-{case.peer}")
def test_each_requirement_is_kept_and_broken(case: Case) -> None:
    check(case)


def test_every_requirement_that_a_rule_judges_is_kept_and_broken_by_a_case() -> None:
    known = requirements("1.1")
    declared = {
        (peer, name) for rule in all_rules() for name in rule.judges for peer in known[name].binds
    }
    covered = {(case.peer, case.requirement) for case in cases()}
    assert declared == covered | ONLY_WITH_THE_OTHER_SIDE_AT_FAULT | ONLY_SEEN_BROKEN
    assert not covered & ONLY_SEEN_BROKEN


@cache
def seen_in_broken_cases() -> set[str]:
    return {s.requirement for case in cases() for s in sightings(case.broken)}


@pytest.mark.parametrize("rule", all_rules(), ids=lambda rule: rule.__name__)
def test_a_rule_judges_what_it_declares(rule: Any) -> None:
    broken = seen_in_broken_cases()
    assert set(rule.judges) <= broken | {name for _, name in ONLY_WITH_THE_OTHER_SIDE_AT_FAULT} | {
        name for _, name in ONLY_SEEN_BROKEN
    }
    assert rule.__doc__


@pytest.mark.parametrize("channel", ["ipc", "msg"])
@pytest.mark.parametrize("c2s", ["c2s", "s2c"])
@pytest.mark.parametrize("s2c", ["c2s", "s2c"])
def test_nobody_is_judged_by_what_binds_the_other_side(
    channel: Channel, c2s: Direction, s2c: Direction
) -> None:
    known = requirements("1.1")
    for case in cases():
        for recording in (case.kept, case.broken):
            turned = {"c2s": c2s, "s2c": s2c, None: None}
            found = [e._replace(channel=channel, dir=turned[e.dir]) for e in recording]
            for sighting in sightings(found):
                assert sighting.peer in known[sighting.requirement].binds


# Whatever crosses the wire

SAID = {
    (client, "ipc"): [
        *(hello(*ALL), hello(), {"type": "subscribe", "channels": ["color"]}),
        *(about_generation(kind) for kind in ("opened", "open_failed", "closed")),
        about_generation("release", seq=1),
    ],
    (client, "msg"): [
        *(hello(*ALL_MSG), POSE, {**POSE, "tag": "a", "intrinsics": INTRINSICS}, OBJECT_POSE),
        *(ASK_SIZE, ASK_CAMERA, {"type": "get_scene", "id": 1}, {"type": "ping", "t": 0.5}),
        *({"type": "set_time", "time": 1.5}, {"type": "set_viewport", "width": 64, "height": 48}),
        *({"type": "subscribe_telemetry", "names": names} for names in (["render_ms"], [], None)),
    ],
    (server, "ipc"): [
        *(welcome(*ALL), welcome(), INIT, HOST_INIT, CUDA_INIT, ADDED, frame(), error("busy")),
        {**frame(2), "objects": [{"object": "chair", **CAMERA, "scale": 0.5}]},
    ],
    (server, "msg"): [
        *(welcome(*ALL_MSG), SIZE, CAMERA, SCENE, PONG, TELEMETRY),
        *({**SIZE, "type": "viewport_size"}, {**CAMERA, "type": "camera_pose"}, error("busy")),
        *(error("unauthorized"), error("unsupported_version", supported=["2.0"])),
    ],
}
"""By whom, and on which channel."""
MESSAGES = [message for messages in SAID.values() for message in messages]
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from([10**400, 2**53, -1, 0, 1, "1", "1e400", "host_shm", "cuda_ipc", "1.1"])
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=6,
)


@st.composite
def spoiled_messages(draw: st.DrawFn) -> bytes:
    """A message of either peer, with some of its members replaced, left out or repeated."""
    message: Any = json.loads(json.dumps(draw(st.sampled_from(MESSAGES))))
    for _ in range(draw(st.integers(0, 2))):
        place = message
        while True:
            names = list(place) if isinstance(place, dict) else list(range(len(place)))
            if not names:
                break
            name = draw(st.sampled_from(names))
            if isinstance(place[name], dict | list) and draw(st.booleans()):
                place = place[name]
            elif draw(st.integers(0, 3)):
                place[name] = draw(VALUES)
                break
            else:
                del place[name]
                break
    text = json.dumps(message)
    return (text[:-1] + ',"type":1}' if draw(st.integers(0, 9)) == 9 else text).encode()


STREAMS = (
    spoiled_messages().map(packet)
    | st.binary(max_size=12)
    | st.binary(min_size=1, max_size=40).map(packet)
    | VALUES.map(lambda value: packet(json.dumps(value).encode()))
)


@st.composite
def entries(draw: st.DrawFn) -> Entry:
    t = draw(st.floats(-10, 100) | st.sampled_from([0.0, 1.0, 2.0]))
    channel = draw(st.sampled_from(["ipc", "msg"]))
    conn, direction = draw(st.integers(1, 2)), draw(st.sampled_from(["c2s", "s2c"]))
    if draw(st.integers(0, 7)) == 0:
        return Entry(t, channel, conn, direction, event=draw(st.sampled_from(["eof", "reset"])))
    return Entry(t, channel, conn, direction, draw(STREAMS))


@st.composite
def sessions(draw: st.DrawFn) -> list[Entry]:
    """A long talk on one connection of some kinds of messages, in any order; ids repeat."""
    channel: Channel = draw(st.sampled_from(["ipc", "msg"]))
    names = ALL_MSG if channel == "msg" else ALL
    kinds = [(by, it) for by in (client, server) for it in SAID[by, channel]]
    some = draw(st.lists(st.sampled_from(kinds), min_size=2, max_size=6))
    ids = st.sampled_from([{}, {"id": 1}, {"id": 2}])
    said = draw(st.lists(st.tuples(st.sampled_from(some), ids), min_size=10, max_size=40))
    steps = (by(message | id_) for (by, message), id_ in said)
    return talk(channel, client(hello(*names)), server(welcome(*names)), *steps)


@settings(deadline=None, max_examples=300)
@given(st.lists(entries(), max_size=12) | sessions())
@example(
    talk(
        "msg",
        *(client(hello(*ALL_MSG)), server(welcome(*ALL_MSG))),
        *(client({"type": "subscribe_telemetry", "names": []}), client({**ASK_SIZE, "id": 1})),
        *(client({"type": "subscribe_telemetry", "names": []}), client({**ASK_SIZE, "id": 2})),
        *(server({**SIZE, "type": "viewport_size", "id": n}) for n in (2, 1)),
    )
)
def test_no_rule_ever_raises_and_none_judges_a_peer_that_is_not_bound(found: list[Entry]) -> None:
    known = requirements("1.1")
    for sighting in sightings(found):
        assert sighting.peer in known[sighting.requirement].binds
    judged = audit(found)
    assert sum(f.broken for f in judged.findings) == sum(breaches(found).values())


@settings(deadline=None, max_examples=60)
@given(st.lists(STREAMS, max_size=4), st.lists(STREAMS, max_size=4))
def test_a_faultless_client_is_never_blamed(before: list[bytes], after: list[bytes]) -> None:
    rubbish = [[raw("s2c", data) for data in each] for each in (before, after)]
    said = {
        "msg": [client(hello(*ALL_MSG)), client(ASK_SIZE), client(POSE)],
        "ipc": [client(hello(*ALL))],
    }
    for channel, steps in said.items():
        found = breaches(talk(channel, *rubbish[0], *steps, *rubbish[1]))
        assert not [breach for breach in found if breach[0] == "client"]


@settings(deadline=None, max_examples=60)
@given(st.lists(STREAMS, max_size=6))
def test_a_faultless_server_is_never_blamed(rubbish: list[bytes]) -> None:
    steps = [raw("c2s", data) for data in rubbish]
    for recording in (
        talk("ipc", server(INIT), *steps),
        talk("ipc", server(CUDA_INIT), *steps),
        talk("msg", client(ASK_SIZE), server(SIZE), client(POSE), *steps),
    ):
        assert not [breach for breach in breaches(recording) if breach[0] == "server"]
