"""The server that the harness plays: what it answers, resizes, tells and lends."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.rules import judge
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.message_kinds import CAPABILITIES
from splatbus_conformance.wire.messages import ring_bytes
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ALL,
    ASK_CAMERA,
    ASK_SIZE,
    INTRINSICS,
    OBJECT_POSE,
    POSE,
    Json,
    about_generation,
    hello,
)
from tests.conformance.trials.wires import Wire

SIZE = (64, 48)
TAGGED = {**POSE, "tag": "a"}
LENS = {**POSE, "intrinsics": INTRINSICS}


class Stage:
    """A role, and its connections; what it says has to keep every rule."""

    def __init__(self, memory: HostMemory, seed: int = 0) -> None:
        self.role, self.recording = ScriptedServer(memory, *SIZE, seed=seed), list[Entry]()

    def steering(self) -> Wire:
        wire = Wire(self.role, "msg", self.recording)
        wire.hear(hello(*CAPABILITIES["msg"]))
        return wire

    def reading(self, *capabilities: str) -> Wire:
        wire = Wire(self.role, "ipc", self.recording)
        wire.hear(hello(*(capabilities or ALL)))
        wire.hear(about_generation("opened", *self.generations(wire)))
        return wire

    def generations(self, wire: Wire) -> list[int]:
        return self.role.with_(wire).generations


@contextmanager
def set_up(seed: int = 0) -> Iterator[Stage]:
    with HostMemory(ring_bytes(128, 96, 3)) as memory:
        stage = Stage(memory, seed)
        yield stage
        broken = [it for it in judge(conversations(stage.recording)) if it.breach]
        assert not [it for it in broken if it.peer == "server"], broken


@pytest.fixture
def stage() -> Iterator[Stage]:
    with set_up() as stage:
        yield stage


def resize(width: int, height: int) -> Json:
    return {"type": "set_viewport", "width": width, "height": height, "id": 7}


def answers(message: Json) -> Callable[[Wire, Wire, Stage], object]:
    return lambda steering, reader, stage: steering.hear(message)


def takes_part(steering: Wire, reader: Wire, stage: Stage) -> None:
    """A reader gives back what it holds, and follows other memory."""
    if stage.role.with_(reader).lends:
        reader.give_back()
    *former, newest = stage.generations(reader)
    if newest not in stage.role.with_(reader).opened:
        reader.hear(about_generation("opened", newest))
        reader.hear(about_generation("closed", former[-1]))


STEPS = [
    takes_part,
    *map(answers, (POSE, TAGGED, LENS, OBJECT_POSE, ASK_SIZE | {"id": 1}, ASK_CAMERA | {"id": 2})),
    *map(answers, ({"type": "get_scene", "id": 3}, {"type": "ping", "t": 0.5, "id": 4})),
    *map(answers, (resize(128, 96), resize(32, 24), resize(*SIZE), resize(129, 96))),
    *(answers({"type": "subscribe_telemetry", "names": it}) for it in (None, ["b", "a"], [])),
]


@settings(max_examples=60)
@given(st.lists(st.sampled_from(STEPS), max_size=16), st.integers(0, 3))
def test_whatever_a_client_may_ask_no_rule_is_broken_by_the_answers(
    steps: list[Callable[[Wire, Wire, Stage], object]], seed: int
) -> None:
    with set_up(seed) as stage:
        steering, reader = stage.steering(), stage.reading()
        for step in steps:
            step(steering, reader, stage)


def test_another_size_is_announced_to_all_who_read(stage: Stage) -> None:
    steering, readers = stage.steering(), [stage.reading() for _ in range(2)]
    (answer,) = steering.hear(resize(32, 24))
    assert answer["viewport_size"] == [32, 24]
    for reader in readers:
        former, newest = stage.generations(reader)
        assert (newest > former, reader.said[-1]["meta"]["w"]) == (True, 32)
        reader.hear(about_generation("opened", newest))
        assert steering.hear(resize(16, 12))[0]["code"] == "busy"
        reader.hear(about_generation("closed", former))
    assert steering.hear(resize(16, 12))[0]["viewport_size"] == [16, 12]
    before = [len(reader.said) for reader in readers]
    steering.hear(resize(16, 12))
    assert [len(reader.said) for reader in readers] == before, "the same size is news to nobody"
    stage.reading("host_shm", "frames")  # who cannot follow
    assert steering.hear(resize(32, 24))[0]["code"] == "unsupported"


@pytest.mark.parametrize("seed", range(2))
def test_generations_begin_otherwise_on_every_second_pair_of_connections(seed: int) -> None:
    with set_up(seed) as stage:
        first, second, third = (stage.generations(stage.reading())[0] for _ in range(3))
    assert first == second
    assert (first == 1, third == 1) == (not seed, bool(seed))


def test_generations_pass_what_32_bits_hold_and_no_more_than_there_are(stage: Stage) -> None:
    reader = stage.reading()
    assert max(stage.role.next_generation(reader) for _ in range(40)) > 2**32
    stage.generations(reader).append(2**53 - 2)
    assert stage.role.next_generation(reader) == 2**53 - 1


def test_a_tag_waits_for_the_release_and_comes_back_once(stage: Stage) -> None:
    steering, reader = stage.steering(), stage.reading()
    before = len(reader.said)
    steering.hear(TAGGED)
    assert len(reader.said) == before
    (frame,) = reader.give_back()
    assert frame["camera"]["tag"] == "a"
    assert frame["camera"]["position"] == list(POSE["position"].values())
    reader.give_back()
    stage.role.lend(reader)
    assert "tag" not in reader.said[-1]["camera"]


def test_intrinsics_are_scaled_and_stay_and_who_lends_knows_those_that_were_said(
    stage: Stage,
) -> None:
    steering, reader = stage.steering(), stage.reading()
    reader.give_back()
    dealings, own = stage.role.with_(reader), stage.role.with_(reader).seen_through
    (answer,) = steering.hear({**ASK_CAMERA, "id": 1})
    assert answer["intrinsics"] == own == stage.role.lens
    steering.hear(LENS)
    for pose in (TAGGED, POSE):
        reader.give_back()
        steering.hear(pose)
        camera = reader.said[-1]["camera"]
        assert camera["fx"] == pytest.approx(1500 * 64 / 1920)
        assert camera["cy"] == pytest.approx(24)
        assert (camera["width"], camera["height"], camera["near"]) == (64, 48, 0.01)
        assert dealings.seen_through == {name: camera[name] for name in own} != own


def test_frames_are_lent_where_nobody_can_guess(stage: Stage) -> None:
    reader = stage.reading()
    for _ in range(29):
        reader.give_back()
        stage.role.lend(reader)
    frames = [it for it in reader.said if it.get("type") == "frame"]
    slots, numbers = [it["slot"] for it in frames], [it["seq"] for it in frames]
    assert [sorted(slots[i : i + 3]) for i in range(0, 30, 3)] == [[0, 1, 2]] * 10
    assert slots != [number % 3 for number in numbers]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] > 2**32
    assert {(it["camera"]["cx"], it["camera"]["cy"]) for it in frames} != {(32.0, 24.0)}
