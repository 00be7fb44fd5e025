"""Memory on a GPU, as a session sees it: announced at once, with a legacy slot for those of 1.0."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from splatbus_server.connection import Connection, Terms
from splatbus_server.exchange import BOTH, WITH_LEGACY
from splatbus_server.memory import Memory
from splatbus_wire.init_packet import CudaMemory, LegacyBuffers
from splatbus_wire.messages import Program
from splatbus_wire.semantics import Semantics

from tests.peers.raw_client import hello
from tests.server.stage import READERS, TERMS, Client, Stage

CAPABILITIES = ("cuda_ipc", "frames", "reinit", "subscribe")
HANDLE = bytes(64)


class DeviceMemory(Memory):
    """Memory of the host that says that it is on a GPU."""

    kind = "cuda_ipc"

    def __init__(self, *arguments: object) -> None:
        super().__init__(*arguments)  # type: ignore[arg-type]
        usual = self.init_packet
        assert usual.ring is not None
        self.init_packet = usual._replace(
            legacy=LegacyBuffers(HANDLE, HANDLE, HANDLE),
            memory=CudaMemory("GPU-" + "0" * 8 + "-0000" * 3 + "-" + "0" * 12, HANDLE, 1 << 20),
            ring=usual.ring._replace(events=(HANDLE,) * usual.ring.slots),
        )

    def successor(self, width: int, height: int) -> Memory:
        return DeviceMemory(width, height, READERS, Semantics(), self.generation + 1)


class DeviceStage(Stage):
    def __init__(self) -> None:
        super().__init__(DeviceMemory(4, 2, READERS, Semantics()))

    def arrive(self, token: str | None = None) -> Client:
        """A connection that has said nothing yet, as the service takes it."""
        terms = Terms(Program("s", "1"), TERMS.capabilities | {"ipc": CAPABILITIES}, token)
        client = Client(self, Connection("ipc", terms, 0.0))
        if token is None:
            self.session.join(client.connection)
        self.catch_up()
        return client

    def reader(self, *capabilities: str) -> Client:
        client = self.arrive()
        client.say(hello(*(capabilities or CAPABILITIES)))
        client.say({"type": "opened", "generation": self.exchange.memory.generation})
        client.hear()
        return client


@pytest.fixture
def stage() -> Iterator[DeviceStage]:
    stage = DeviceStage()
    yield stage
    for memory in (*stage.exchange.replaced, stage.exchange.memory):
        memory.close()


def test_the_init_packet_is_sent_at_once_and_once(stage: DeviceStage) -> None:
    """[CHN-4, NEG-15]"""
    client = stage.arrive()
    (packet,) = client.hear()
    assert packet["version"] == "1.1"
    assert packet["memory"]["kind"] == "cuda_ipc"
    assert packet["mem_color"]
    client.say(hello(*CAPABILITIES))
    assert [message["type"] for message in client.hear()] == ["welcome"]


def test_with_a_token_it_is_sent_after_hello_only(stage: DeviceStage) -> None:
    """[NEG-18]"""
    client = stage.arrive(token="secret")
    assert client.hear() == []
    client.say(hello(*CAPABILITIES, token="secret"))
    welcome, packet = client.hear()
    assert welcome["type"] == "welcome"
    assert packet["memory"]["kind"] == "cuda_ipc"


def test_nothing_of_images_is_said_on_the_message_channel(stage: DeviceStage) -> None:
    client = Client(stage, Connection("msg", TERMS, 0.0))
    client.say(hello())
    assert [message["type"] for message in client.hear()] == ["welcome"]
    assert stage.view() is None


def test_a_silent_client_has_the_legacy_slot_written(stage: DeviceStage) -> None:
    stage.arrive()
    view = stage.view()
    assert view is not None
    assert view.wants == WITH_LEGACY
    stage.publish(view)
    assert stage.view() is None


def test_with_frames_only_the_ring_is_written(stage: DeviceStage) -> None:
    reader = stage.reader()
    view = stage.view()
    assert view is not None
    assert view.wants == BOTH
    stage.publish(view)
    assert reader.frame()["slot"] == 0


def test_a_client_of_1_0_that_joins_is_shown_the_scene_at_rest(stage: DeviceStage) -> None:
    stage.reader()
    stage.publish()
    assert stage.view() is None
    old = stage.arrive()
    stage.publish()
    assert stage.view() is None
    stage.arrive()
    assert stage.view() is None
    old.leave()


def test_the_legacy_slot_rests_when_its_last_client_leaves(stage: DeviceStage) -> None:
    stage.reader()
    old = stage.arrive()
    stage.publish()
    old.leave()
    view = stage.exchange.next_view(0, True)
    assert view is not None
    assert view.wants == BOTH


def test_clients_beyond_the_slots_are_refused_though_they_joined(stage: DeviceStage) -> None:
    """[IMG-18]"""
    for _ in range(READERS):
        stage.reader()
    for _ in range(3):  # those who were refused stay until their connections have ended
        client = stage.arrive()
        (refusal,) = client.say(hello(*CAPABILITIES))
        assert refusal.code == "too_many_clients"


def test_a_place_that_is_free_again_is_not_kept_by_who_was_refused(stage: DeviceStage) -> None:
    """[IMG-18]"""
    first, *_ = [stage.reader() for _ in range(READERS)]
    stage.arrive().say(hello(*CAPABILITIES))
    first.leave()
    assert stage.arrive().say(hello(*CAPABILITIES)) == []


def test_a_client_of_1_0_is_disconnected_by_another_size(stage: DeviceStage) -> None:
    """[OPN-7]"""
    old = stage.arrive()
    stage.resize(8, 4)
    assert old.connection.ending
    assert stage.view() is None
    assert len(stage.exchange.replaced) == 1
    old.leave()
    assert not stage.exchange.replaced
