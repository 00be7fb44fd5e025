"""What the wire, and the judge, make of the vectors for framing, numbers, poses and axes."""

import math

import numpy as np
import pytest
from splatbus_conformance.images.pinhole import rigid
from splatbus_conformance.oracle import U, orthogonality_error
from splatbus_conformance.wire.packets import Splitter
from splatbus_wire.conventions import ENGINES
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.framing import PacketDecoder
from splatbus_wire.json_text import parse_object, serialize
from splatbus_wire.messages import CameraPose, decode_from_client
from splatbus_wire.plain_poses import plain_pose
from splatbus_wire.poses import Pose, as_array, camera_centre, view_matrix, world_matrix
from splatbus_wire.rotations import rotation_matrix

from tests.spec.vector_files import DOCUMENTS, cases, doubles, is_near, ulp

# ---- framing


def joined(pieces):
    return b"".join(bytes.fromhex(piece["hex"]) * piece.get("times", 1) for piece in pieces)


def delivered(case):
    stream, cuts = joined(case["stream"]), case["cuts"]
    edges = range(1, len(stream)) if cuts == "every byte" else cuts
    yield [stream[a:b] for a, b in zip([0, *edges], [*edges, len(stream)], strict=True)]
    yield [stream]
    if len(stream) < 1000:
        yield [stream[i : i + 1] for i in range(len(stream))]


def drain(decoder):
    """The packets that are handed out, and the refusal that ends them."""
    packets = []
    try:
        for packet in iter(decoder.next_packet, None):
            packets.append(packet)
    except FramingError as error:
        return packets, error
    return packets, None


@cases("framing")
def test_the_wire_finds_the_packets(case):
    for parts in delivered(case):
        decoder = PacketDecoder()
        for part in parts:
            decoder.receive(part)
        packets, refusal = drain(decoder)
        assert packets == [joined(payload) for payload in case["packets"]]
        assert decoder.incomplete == (case["outcome"] == "incomplete")
        if case["outcome"] == "refused":
            assert (refusal.requirement, refusal.offset) == ("FRM-3", case["offset"])
        else:
            assert refusal is None


@cases("framing")
def test_the_judge_finds_the_packets(case):
    for parts in delivered(case):
        splitter = Splitter()
        packets = [packet.payload for part in parts for packet in splitter.feed(part, 0.0)]
        assert packets == [joined(payload) for payload in case["packets"]]
        assert splitter.refused == (case["offset"] if case["outcome"] == "refused" else None)
        assert bool(splitter.rest) == (case["outcome"] != "whole")


# ---- numbers


def spelled(spelling):
    if isinstance(spelling, str):
        return spelling
    return "".join(piece["text"] * piece.get("times", 1) for piece in spelling)


def read(case):
    """What the wire reads where the description of the file puts the spelling."""
    spelling, is_text = spelled(case["spelling"]), case["spelling"][0] == '"'
    x, timestamp = (spelling, "0") if is_text else ("0", spelling)
    payload = (
        f'{{"type":"camera_pose","timestamp":{timestamp},"position":{{"x":{x},"y":0,"z":0}},'
        '"rotation":{"x":0,"y":0,"z":0,"w":1}}'
    )
    message = decode_from_client(payload.encode(), "msg", said_hello=False)
    assert isinstance(message, CameraPose)
    return message.pose.position[0] if is_text else message.timestamp


@cases("numbers", verdict="accepted")
def test_the_wire_reads_the_number(case):
    assert read(case) == float.fromhex(case["value"]["hex"])


@cases("numbers", verdict="rejected")
def test_the_wire_rejects_the_spelling(case):
    with pytest.raises(ProtocolError) as caught:
        read(case)
    if case["spelling"][0] == '"':
        # It breaks more than one clause: it is no JSON number, and x has to be a number.
        assert caught.value.pointer == "/position/x"
    else:
        assert caught.value.requirement == case["requirement"]


@cases("numbers", verdict="optional")
def test_the_wire_reads_the_string(case):
    assert read(case) == float.fromhex(case["value"]["hex"])


@cases("numbers", verdict="printed")
def test_the_wire_prints_the_number_with_enough_digits(case):
    value = float(doubles(case["value"]))
    [member] = parse_object(serialize({"value": value})).values()
    assert member == value


@cases("numbers", verdict="printed")
def test_the_digits_that_are_enough_read_back_and_the_others_do_not(case):
    value = float(doubles(case["value"]))

    def held(spelling):
        read = parse_object(f'{{"value":{spelling}}}'.encode())["value"]
        return float(np.float32(read)) if case["precision"] == "single" else float(read)

    assert [spelling for spelling in case["enough"] if held(spelling) != value] == []
    assert [spelling for spelling in case["too_few"] if held(spelling) == value] == []


# ---- poses


def pose_of(value):
    position, rotation = doubles(value["position"]).tolist(), doubles(value["rotation"]).tolist()
    return Pose(tuple(position), tuple(rotation))


def message(pose):
    x, y, z = map(repr, pose.position)
    i, j, k, w = map(repr, pose.rotation)
    return (
        f'{{"type":"camera_pose","position":{{"x":{x},"y":{y},"z":{z}}},'
        f'"rotation":{{"x":{i},"y":{j},"z":{k},"w":{w}}}}}'
    ).encode()


@cases("poses", verdict="accepted")
def test_the_wire_takes_the_pose_and_makes_the_matrices(case):
    pose = pose_of(case["pose"])
    assert decode_from_client(message(pose), "msg", said_hello=False).pose == pose
    assert plain_pose(message(pose)).pose == pose
    expected = {quantity: doubles(value) for quantity, value in case["expected"].items()}
    R = np.reshape(rotation_matrix(pose.rotation), (3, 3))
    view = view_matrix(pose)
    got, right = as_array(view), expected["view_matrix"]
    assert is_near("poses", "rotation_matrix", R, expected["rotation_matrix"])
    assert orthogonality_error(R.tolist()) <= 16 * U  # ACC-3
    assert is_near("poses", "view_rotation", got[:3, :3], right[:3, :3])
    assert is_near("poses", "view_translation", got[:3, 3], right[:3, 3])
    assert got[3].tolist() == right[3].tolist()
    assert is_near("poses", "camera_centre", camera_centre(view), expected["camera_centre"])
    world = as_array(world_matrix(pose))
    assert (world[:3, :3] == R).all()
    assert world[:3, 3].tolist() == list(pose.position)


@cases("poses", verdict="accepted")
def test_in_single_precision_the_view_is_off_by_an_ulp_at_most(case):
    got = as_array(view_matrix(pose_of(case["pose"])), np.float32)[:3, 3].astype(float)
    expected = doubles(case["expected"]["view_matrix"])[:3, 3]
    assert np.linalg.norm(got - expected) <= ulp(np.linalg.norm(expected), 23, -126)  # ACC-6


@cases("poses", verdict="rejected")
def test_the_wire_rejects_the_pose(case):
    pose = pose_of(case["pose"])
    assert plain_pose(message(pose)) is None
    with pytest.raises(ProtocolError) as caught:
        decode_from_client(message(pose), "msg", said_hello=False)
    assert caught.value.requirement == case["requirement"]


@cases("poses", verdict="accepted")
def test_the_judges_camera_turns_alike(case):
    R = rigid(*map(doubles, case["pose"].values())).rotation
    expected = doubles(case["expected"]["rotation_matrix"])
    assert is_near("poses", "rotation_matrix", R, expected)


# ---- conventions


@cases("conventions")
def test_the_wire_changes_the_axes(case):
    engine = ENGINES[case["engine"]]
    change = engine.from_wire if case["direction"] == "from_wire" else engine.to_wire
    got, expected = change(pose_of(case["pose"])), pose_of(case["expected"])
    assert is_near("conventions", "position", got.position, expected.position)
    assert is_near("conventions", "rotation", got.rotation, expected.rotation)
    assert math.copysign(1, np.dot(got.rotation, expected.rotation)) == 1


@pytest.mark.parametrize("name", ["conventions", "projections"])
def test_the_engines_are_those_of_the_wire(name):
    stated = {key: row for key, row in DOCUMENTS[name]["engines"].items() if key != "wire"}
    assert stated.keys() == ENGINES.keys()
    for key, row in stated.items():
        engine = ENGINES[key]
        assert engine.world == tuple(np.ravel(row["world"]))
        assert engine.camera == tuple(np.ravel(row["camera"]))
        assert engine.scale == row["scale"]
