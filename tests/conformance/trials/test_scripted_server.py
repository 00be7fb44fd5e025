"""The server that the harness plays: what it answers, resizes, tells and lends."""

from typing import Any

import pytest
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.rules import judge
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.wire.conversation import Assembler, Message, conversations
from splatbus_conformance.wire.message_kinds import CAPABILITIES
from splatbus_conformance.wire.messages import ring_bytes
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ALL,
    ASK_CAMERA,
    INTRINSICS,
    OBJECT_POSE,
    POSE,
    about_generation,
    changed,
    hello,
    text,
)

SIZE = (64, 48)
TAGGED = {**POSE, "tag": "a"}
LENS = {**POSE, "intrinsics": INTRINSICS}


class Wire:
    """A connection without sockets, and what the role said on it."""

    def __init__(
        self, role: ScriptedServer, channel: Any, recording: list[Entry], number: int
    ) -> None:
        self.channel, self.open, self.ended = channel, True, None
        self.role, self.recording, self.number = role, recording, number
        self.said: list[dict] = []
        self.sent: list[bytes] = []
        self._assembler = Assembler()
        role.on_open(self)

    def send(self, data: bytes) -> None:
        self.sent.append(data)
        self.said += [message.value or {} for message in self._note("s2c", data)]

    def hear(self, *messages: dict) -> list[dict]:
        """What the role says to messages that arrive together, on this connection."""
        payloads = [text(message) for message in messages]
        data = b"".join(len(it).to_bytes(4, "little") + it for it in payloads)
        before = len(self.said)
        for message in self._note("c2s", data):
            self.role.on_message(self, message)
        return self.said[before:]

    def give_back(self) -> list[dict]:
        """What the role says to the release of the frame that it lent last."""
        frame = self.said[-1]
        return self.hear(about_generation("release", frame["generation"], seq=frame["seq"]))

    @property
    def generations(self) -> list[int]:
        """Of the init packets that it was sent."""
        return [message["generation"] for message in self.said if "meta" in message]

    def _note(self, direction: Any, data: bytes) -> list[Message]:
        now = 1.0 + 0.01 * len(self.recording)
        entry = Entry(now, self.channel, self.number, direction, data)
        self.recording.append(entry)
        return self._assembler.feed(entry)[1]


class Stage:
    """A role, and its connections; what it says has to keep every rule."""

    def __init__(self, memory: HostMemory, seed: int = 0) -> None:
        self.role, self.recording = ScriptedServer(memory, *SIZE, seed=seed), []

    def connect(self, channel: Any, *capabilities: str) -> Wire:
        wire = Wire(self.role, channel, self.recording, len(self.role.dealings))
        wire.hear(hello(*capabilities))
        return wire

    def steering(self) -> Wire:
        return self.connect("msg", *CAPABILITIES["msg"])

    def reading(self, *capabilities: str) -> Wire:
        wire = self.connect("ipc", *(capabilities or ALL))
        wire.hear(about_generation("opened", *wire.generations))
        return wire


@pytest.fixture
def stage():
    with HostMemory(ring_bytes(128, 96, 3)) as memory:
        stage = Stage(memory)
        yield stage
        broken = [s for s in judge(conversations(stage.recording)) if s.breach]
        assert not [s for s in broken if s.peer == "server"], broken


def resize(width: int, height: int) -> dict:
    return {"type": "set_viewport", "width": width, "height": height, "id": 7}


@pytest.mark.parametrize(
    ("request_", "kind"),
    [
        ({"type": "get_scene", "id": 1}, "scene"),
        ({"type": "ping", "t": 0.5, "id": 1}, "pong"),
        ({**ASK_CAMERA, "id": 1}, "camera"),
        (resize(128, 96), "viewport_size"),
        (resize(129, 96), "error"),
    ],
)
def test_every_request_is_answered(stage, request_, kind):
    (answer,) = stage.steering().hear(request_)
    assert (answer["type"], answer["id"]) == (kind, request_["id"])
    assert ("intrinsics" in answer) == (kind == "camera")


def test_until_there_is_an_image_no_size_is_told(stage):
    stage.role.has_image = False
    steering, reader = stage.steering(), stage.reading()
    camera, size = steering.hear({**ASK_CAMERA, "id": 1}, {"type": "get_viewport_size", "id": 2})
    assert camera["intrinsics"]["width"] == 64
    assert size["viewport_size"] == [0, 0]
    assert [it.get("type") for it in reader.said] == ["welcome", None]
    (size,) = steering.hear(resize(128, 96))
    assert size["viewport_size"] == [128, 96]


def test_before_welcome_requests_of_1_1_are_not_known(stage):
    stage.role.welcomes = False
    assert stage.steering().hear({"type": "ping", "t": 0.5}) == []


def test_another_size_is_announced_to_all_who_read(stage):
    steering, readers = stage.steering(), [stage.reading() for _ in range(2)]
    (answer,) = steering.hear(resize(32, 24))
    assert answer["viewport_size"] == [32, 24]
    for reader in readers:
        former, newest = reader.generations
        assert (newest > former, reader.said[-1]["meta"]["w"]) == (True, 32)
        reader.hear(about_generation("opened", newest))
        assert steering.hear(resize(16, 12))[0]["code"] == "busy"
        reader.hear(about_generation("closed", former))
    assert steering.hear(resize(16, 12))[0]["viewport_size"] == [16, 12]


@pytest.mark.parametrize("seed", range(2))
def test_generations_begin_otherwise_on_every_second_pair_of_connections(stage, seed):
    stage = Stage(stage.role.memory, seed)
    first, second, third = (stage.reading().generations[0] for _ in range(3))
    assert first == second
    assert (first == 1, third == 1) == (not seed, bool(seed))


def test_generations_pass_what_32_bits_hold_and_no_more_than_there_are(stage):
    numbers = [stage.role.next_generation(stage.reading()) for _ in range(40)]
    assert max(numbers) > 2**32
    reader = stage.reading()
    stage.role.with_(reader).generations.append(2**53 - 2)
    assert stage.role.next_generation(reader) == 2**53 - 1


def test_the_same_size_is_announced_to_nobody(stage):
    reader, before = stage.reading(), 3
    assert stage.steering().hear(resize(*SIZE))[0]["viewport_size"] == list(SIZE)
    assert len(reader.said) == before


def test_no_other_size_for_those_who_could_not_follow(stage):
    stage.reading("host_shm", "frames")
    assert stage.steering().hear(resize(32, 24))[0]["code"] == "unsupported"


def test_a_tag_comes_back_once_from_where_it_was_sent(stage):
    steering, reader = stage.steering(), stage.reading()
    reader.give_back()
    steering.hear(TAGGED)
    camera = reader.said[-1]["camera"]
    assert (camera["tag"], camera["position"]) == ("a", list(POSE["position"].values()))
    reader.give_back()
    stage.role.lend(reader)
    assert "tag" not in reader.said[-1]["camera"]


def test_a_tag_waits_for_the_release(stage):
    steering, reader = stage.steering(), stage.reading()
    before = len(reader.said)
    steering.hear(TAGGED)
    assert len(reader.said) == before
    (frame,) = reader.give_back()
    assert frame["camera"]["tag"] == "a"


def test_intrinsics_are_scaled_and_stay(stage):
    steering, reader = stage.steering(), stage.reading()
    reader.give_back()
    steering.hear(LENS)
    reader.give_back()
    steering.hear(TAGGED)
    for frame in reader.said[-2:]:
        camera = frame["camera"]
        assert camera["fx"] == pytest.approx(1500 * 64 / 1920)
        assert camera["cy"] == pytest.approx(24)
        assert (camera["width"], camera["height"], camera["near"]) == (64, 48, 0.01)


def test_who_lends_knows_the_lens_that_was_said_and_not_the_one_that_was_meant(stage):
    steering, reader = stage.steering(), stage.reading()
    reader.give_back()
    own = stage.role.with_(reader).seen_through
    assert own == stage.role.lens
    steering.hear(LENS)  # as a viewer does at any moment
    reader.give_back()
    said = stage.role.with_(reader).seen_through
    assert said["fx"] == pytest.approx(1500 * 64 / 1920) != own["fx"]
    assert said == {name: reader.said[-1]["camera"][name] for name in said}


@pytest.mark.parametrize(
    "pose", [POSE, changed(LENS, "/intrinsics/fx", 0), changed(TAGGED, "/rotation/w"), OBJECT_POSE]
)
def test_other_poses_change_no_camera(stage, pose):
    stage.steering().hear(pose)
    assert stage.role.viewpoint is None


@pytest.mark.parametrize(
    ("names", "told"),
    [(None, ["render_ms", "opacity", "stage"]), (["b", "a"], ["b", "a"]), ([], None)],
)
def test_telemetry_is_told_of_what_was_subscribed_to(stage, names, told):
    said = stage.steering().hear({"type": "subscribe_telemetry", "names": names})
    assert [[series["name"] for series in message["series"]] for message in said] == (
        [told] if told else []
    )


def test_all_kinds_of_series_are_told(stage):
    (message,) = stage.steering().hear({"type": "subscribe_telemetry", "names": None})
    assert {series["kind"] for series in message["series"]} == {"scalar", "histogram", "text"}


def test_frames_are_lent_where_nobody_can_guess(stage):
    reader = stage.reading()
    frames = [reader.said[-1]]
    for _ in range(29):
        reader.give_back()
        stage.role.lend(reader)
        frames.append(reader.said[-1])
    slots, numbers = [it["slot"] for it in frames], [it["seq"] for it in frames]
    assert [sorted(slots[i : i + 3]) for i in range(0, 30, 3)] == [[0, 1, 2]] * 10
    assert slots != [number % 3 for number in numbers]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] > 2**32
    assert {(it["camera"]["cx"], it["camera"]["cy"]) for it in frames} != {(32.0, 24.0)}


def test_the_lens_of_a_reply_is_that_of_the_frames(stage):
    steering, reader = stage.steering(), stage.reading()
    (answer,) = steering.hear({**ASK_CAMERA, "id": 1})
    assert answer["intrinsics"].items() <= reader.said[-1]["camera"].items()
