"""All rules together: made-up sessions break what they say, and nobody is blamed for the other."""

import json
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from splatbus_conformance.observe.audit import audit
from splatbus_conformance.rules import Sighting, all_rules, sightings
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Entry
from splatbus_schemas import VERSIONS, examples
from splatbus_schemas.model.metamodel import metamodel
from splatbus_schemas.requirements import requirements

from tests.conformance.rules.talk import (
    ALL,
    ALL_MSG,
    ASK_SIZE,
    CUDA_INIT,
    INIT,
    POSE,
    SIZE,
    Step,
    breaches,
    client,
    hello,
    ipc,
    msg,
    named,
    raw,
    server,
    talk,
    welcome,
)

FILES = sorted(Path(__file__).parent.glob("v1_*/*.py"))
TALKS: dict[str, tuple[list[Entry], str]] = {
    f"{it.stem}: {title}": said
    for it in FILES
    for title, said in import_module(f"{__package__}.{it.parent.name}.{it.stem}").TALKS.items()
}
ONLY_SEEN_BROKEN = {("server", "CHN-5"), ("server", "JSN-8"), ("client", "JSN-8")}


@pytest.mark.parametrize(("recording", "broken"), TALKS.values(), ids=TALKS)
def test_a_session_breaks_what_it_says(recording: list[Entry], broken: str) -> None:
    unseen = {it for it in broken.split() if it.startswith("!")}
    assert breaches(recording) == sorted(it for it in broken.split() if it not in unseen)
    assert unseen.isdisjoint(f"!{named(it)}" for it in sightings(recording))


def test_every_requirement_that_a_rule_judges_is_seen_to_be_kept() -> None:
    """That each is seen to be broken, the zoo shows."""
    known = requirements("1.1")
    judged = {
        (peer, name) for rule in all_rules() for name in rule.judges for peer in known[name].binds
    }
    found = (it for recording, _ in TALKS.values() for it in sightings(recording))
    kept = {(it.peer, it.requirement) for it in found if not it.breach}
    assert kept == judged - ONLY_SEEN_BROKEN


@pytest.mark.parametrize("channel", ["ipc", "msg"])
@pytest.mark.parametrize("other", [{}, {"c2s": "s2c", "s2c": "c2s"}], ids=["as it is", "turned"])
def test_nobody_is_judged_by_what_binds_the_other_side(channel: Channel, other: Any) -> None:
    for recording, _ in TALKS.values():
        found = (it._replace(channel=channel, dir=other.get(it.dir, it.dir)) for it in recording)
        assert_bound(sightings(found))


def assert_bound(found: Iterable[Sighting]) -> None:
    known = requirements("1.1")
    for sighting in found:
        assert sighting.peer in known[sighting.requirement].binds


# Whatever crosses the wire

SAID: dict[str, list[tuple[Callable[[Any], Step], Any]]] = {
    channel: [
        ({"client": client, "server": server}[it["from"]], example.message)
        for version in VERSIONS
        for it in metamodel()["versions"][version]["messages"]
        if on in it["channels"]
        for example in examples(it["name"], version)[0][:3]
    ]
    for channel, on in (("ipc", "ipc"), ("msg", "message"))
}
"""On each channel, by whom, and what."""
MESSAGES = [message for said in SAID.values() for _, message in said]
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
    some = draw(st.lists(st.sampled_from(SAID[channel]), min_size=2, max_size=6))
    ids = st.sampled_from([{}, {"id": 1}, {"id": 2}])
    said = draw(st.lists(st.tuples(st.sampled_from(some), ids), min_size=10, max_size=40))
    steps = (by(message | id_) for (by, message), id_ in said)
    return talk(channel, client(hello(*names)), server(welcome(*names)), *steps)


@settings(deadline=None, max_examples=300)
@given(st.lists(entries(), max_size=12) | sessions())
@example(
    msg(
        *(client(hello(*ALL_MSG)), server(welcome(*ALL_MSG))),
        *(client({"type": "subscribe_telemetry", "names": []}), client({**ASK_SIZE, "id": 1})),
        *(client({"type": "subscribe_telemetry", "names": []}), client({**ASK_SIZE, "id": 2})),
        *(server({**SIZE, "type": "viewport_size", "id": n}) for n in (2, 1)),
    )
)
def test_no_rule_ever_raises_and_none_judges_a_peer_that_is_not_bound(found: list[Entry]) -> None:
    assert_bound(sightings(found))
    judged = audit(found)
    assert sum(f.broken for f in judged.findings) == len(breaches(found))


@settings(deadline=None, max_examples=60)
@given(st.lists(STREAMS, max_size=4), st.lists(STREAMS, max_size=4))
def test_a_faultless_client_is_never_blamed(before: list[bytes], after: list[bytes]) -> None:
    rubbish = [[raw("s2c", data) for data in each] for each in (before, after)]
    said = {
        "msg": [client(hello(*ALL_MSG)), client(ASK_SIZE), client(POSE)],
        "ipc": [client(hello(*ALL))],
    }
    for channel, steps in said.items():
        found = sightings(talk(channel, *rubbish[0], *steps, *rubbish[1]))
        assert not [it for it in found if it.breach and it.peer == "client"]


@settings(deadline=None, max_examples=60)
@given(st.lists(STREAMS, max_size=6))
def test_a_faultless_server_is_never_blamed(rubbish: list[bytes]) -> None:
    steps = [raw("c2s", data) for data in rubbish]
    for recording in (
        ipc(server(INIT), *steps),
        ipc(server(CUDA_INIT), *steps),
        msg(client(ASK_SIZE), server(SIZE), client(POSE), *steps),
    ):
        assert not [it for it in sightings(recording) if it.breach and it.peer == "server"]
