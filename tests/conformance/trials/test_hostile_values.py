"""Whatever a testee puts into a message, the harness judges it, and does not fall over it."""

import contextlib

import pytest
from splatbus_conformance.images.captured import photograph_of, shows_the_scene
from splatbus_conformance.images.memory.cuda_stand_in.publishing import planes_of
from splatbus_conformance.images.memory.device_reading import open_on_device
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.images.memory.reading import CannotOpen
from splatbus_conformance.images.pinhole import placed_in
from splatbus_conformance.plan import SIDES
from splatbus_conformance.reports import latencies
from splatbus_conformance.rules import judge
from splatbus_conformance.trials.controls import shows
from splatbus_conformance.trials.moves.resizing import size_of
from splatbus_conformance.trials.scripted_client import ScriptedClient, readable
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.trials.testee import probe_advice
from splatbus_conformance.trials.testee.client_probe import ClientFacts
from splatbus_conformance.trials.testee.server_probe import ServerFacts
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.json_reading import read
from splatbus_conformance.wire.recording import Entry
from splatbus_conformance.wire.transcript import excerpt

from tests.conformance.rules.talk import (
    ALL_MSG,
    ASK_CAMERA,
    ASK_SIZE,
    HOST_INIT,
    POSE,
    about_generation,
    changed,
    frame,
    hello,
    welcome,
)
from tests.conformance.trials.hostile import FROM_CLIENT, FROM_SERVER, spoiled
from tests.conformance.trials.wires import Wire

pytestmark = pytest.mark.apart

ON_IPC = ("host_shm", "frames", "reinit", "subscribe")


def judged(entries: list[Entry]) -> None:
    """Every reader of recordings reads this one."""
    found = conversations(entries)
    assert list(judge(found))
    for side in SIDES:
        latencies.of(found, side)
    assert list(excerpt(entries, 100))


class Nowhere:
    """A device that nothing can be read of."""

    def named(self, uuid: object) -> "Nowhere":
        return self

    def read(self, *place: object) -> bytes:
        raise ValueError("nothing is here")

    def forget(self, handle: bytes) -> None:
        """There is nothing to forget."""


NEEDS = ("hello:ipc", "capability:frames", "asks", "says:camera_pose", "opens", "returns:ipc")


@pytest.mark.parametrize("kind", FROM_CLIENT)
def test_a_client_can_say_what_it_likes(kind: str) -> None:
    channel, message = FROM_CLIENT[kind]
    with HostMemory(1 << 20) as memory:
        for payload in spoiled(message):
            play_server(memory, channel, payload)


def play_server(memory: HostMemory, channel: str, payload: bytes) -> None:
    """The harness plays the server, to a client that says something good, this, and good again."""
    role, recording = ScriptedServer(memory, 64, 48), list[Entry]()
    ipc, msg = Wire(role, "ipc", recording), Wire(role, "msg", recording)
    hostile = ipc if channel == "ipc" else msg
    for wire, greeting in ((ipc, hello(*ON_IPC)), (msg, hello(*ALL_MSG))):
        wire.hear(payload if b'"hello"' in payload and wire is hostile else greeting)
    ipc.hear(about_generation("opened"))
    hostile.hear(payload)
    ipc.hear(about_generation("opened"))
    for said in (POSE | {"tag": "b"}, ASK_SIZE, ASK_CAMERA, {"type": "subscribe_telemetry"}):
        msg.hear(said)
    msg.hear({"type": "set_viewport", "width": 16, "height": 16})
    for wire in (ipc, msg):
        dealings = role.with_(wire)
        assert isinstance(dealings.granted, list)
        assert dealings.lends in (True, False)
        role.lend(ipc)
        role.tell(msg)
    judged(recording)
    facts = ClientFacts(hello={"ipc": role.with_(ipc).hello, "msg": role.with_(msg).hello})
    assert str(facts)
    assert [facts.lacks(need) for need in NEEDS]
    probe_advice.on_client([observed(it) for it in (ipc, msg)], {"ipc": 1, "msg": 2}, None)


def observed(wire: Wire) -> probe_advice.ObservedConnection:
    return probe_advice.ObservedConnection(wire.channel, 1, wire.part.with_(wire).heard)


@pytest.mark.parametrize("kind", FROM_SERVER)
def test_a_server_can_say_what_it_likes(kind: str) -> None:
    channel, message = FROM_SERVER[kind]
    with HostMemory(1 << 20) as memory:
        for payload in spoiled(message):
            play_client(memory, channel, payload)


_looked_at: set[str] = set()
"""What was asked for whether it shows the scene, which takes longest."""


def play_client(memory: HostMemory, channel: str, payload: bytes) -> None:
    """The harness plays the viewer, and hears something good, this, and good again."""
    viewer, recording = ScriptedClient(), list[Entry]()
    payload = payload.replace(HOST_INIT["memory"]["name"].encode(), memory.name.encode())
    announced = changed(HOST_INIT, "/memory/name", memory.name)
    ipc, msg = Wire(viewer, "ipc", recording), Wire(viewer, "msg", recording)
    hostile = ipc if channel == "ipc" else msg
    for wire, answer in ((ipc, welcome(*ON_IPC)), (msg, welcome(*ALL_MSG))):
        viewer.greet(wire)
        wire.hear(payload if b'"welcome"' in payload and wire is hostile else answer)
        assert isinstance(viewer.with_(wire).granted, list)
    for asked in (ASK_SIZE, ASK_CAMERA, {"type": "get_scene"}, {"type": "ping", "t": 1.0}):
        viewer.say(msg, {**asked, "id": 1})
    if hostile is ipc and b'"frame"' in payload:
        ipc.hear(announced)
    hostile.hear(payload)
    ipc.hear(announced, frame())
    judged(recording)
    dealings = viewer.with_(ipc)
    assert all(isinstance(code, str) for code in viewer.with_(hostile).errors())
    viewer.let_go(ipc)
    value = read(payload).value or {}
    facts = ServerFacts(
        welcome={"ipc": dealings.welcome, "msg": viewer.with_(msg).welcome},
        init_packet=next(iter(dealings.init_packets), None),
        scene=value,
    )
    facts.setting(value)
    assert str(facts)
    assert facts.objects()
    assert all(isinstance(name, str) for name in facts.capabilities("ipc"))
    assert all(map(readable, dealings.frames))
    packets = dealings.init_packets
    photographed = dealings.frames if hostile is ipc or b'"scene"' in payload else []
    for frame_ in [value] if b'"frame"' in payload else (*photographed, value):
        if dealings.memory and (seen := photograph_of(frame_, dealings.memory, packets[-1])):
            assert seen.view()
            setting = facts.setting(frame_)
            same = repr((frame_, seen.semantics, seen.color.shape, setting))
            if same not in _looked_at:  # memory holds nothing but zeros
                _looked_at.add(same)
                assert shows_the_scene(seen, setting) in (True, False)
        assert shows(frame_, POSE) in (True, False)
        assert placed_in(frame_, "default")
        assert placed_in(frame_, "chair")
    for init_packet in packets:
        size_of(init_packet)
        planes_of(init_packet)
        with contextlib.suppress(CannotOpen):
            open_on_device(init_packet, Nowhere())
    probe_advice.on_server([observed(wire) for wire in (ipc, msg)])
    viewer.close()
