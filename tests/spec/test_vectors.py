"""The vectors are what the oracle makes, what their schema allows, and what the wire does."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from splatbus_conformance.oracle.vectors.__main__ import FILES, main
from splatbus_conformance.packets import Splitter
from splatbus_schemas import requirements
from splatbus_wire.compositing import over_premultiplied, over_straight
from splatbus_wire.conventions import ENGINES
from splatbus_wire.depth import planar_depth
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.framing import PacketDecoder
from splatbus_wire.messages import CameraPose, decode_from_client
from splatbus_wire.poses import Pose, as_array, camera_centre, view_matrix
from splatbus_wire.rotations import rotation_matrix

FOLDER = Path(__file__).parents[2] / "spec" / "vectors"
DOCUMENTS = {name: json.loads((FOLDER / name).read_text("utf-8")) for name in FILES}
VALIDATOR = Draft202012Validator(json.loads((FOLDER / "vectors.schema.json").read_text("utf-8")))


def cases(name, **members):
    """The cases of a file that have these members, as parameters named after them."""
    chosen = [case for case in DOCUMENTS[name]["cases"] if members.items() <= case.items()]
    return pytest.mark.parametrize("case", chosen, ids=lambda case: case["name"])


every_file = pytest.mark.parametrize("name", FILES)


def tolerance(name, quantity):
    entry = DOCUMENTS[name]["tolerances"][quantity]
    return entry["measure"], entry["bound"]["decimal"]


def doubles(number):
    return np.vectorize(float.fromhex, otypes=[float])(number["hex"])


# ---- as documents


@every_file
def test_the_file_is_what_its_schema_allows(name):
    VALIDATOR.check_schema(VALIDATOR.schema)
    assert [error.message for error in VALIDATOR.iter_errors(DOCUMENTS[name])] == []


def test_the_schema_tells_wrong_files():
    broken = json.loads(json.dumps(DOCUMENTS["poses.json"]))
    broken["cases"][3]["pose"]["rotation"]["hex"].pop()
    assert not VALIDATOR.is_valid(broken)
    assert not VALIDATOR.is_valid({**DOCUMENTS["numbers.json"], "name": "framing"})


def test_the_folder_holds_what_the_oracle_makes(capsys):
    assert main(["--check", "--directory", str(FOLDER)]) == 0
    assert capsys.readouterr().out == ""
    assert {path.name for path in FOLDER.glob("*.json")} == {*FILES, "vectors.schema.json"}


def test_a_file_that_differs_is_named_and_can_be_written_anew(tmp_path, capsys):
    assert main(["--directory", str(tmp_path)]) == 0
    poses = tmp_path / "poses.json"
    poses.write_text(poses.read_text("utf-8").replace("0x1.0p+0", "0x1.1p+0", 1), "utf-8")
    (tmp_path / "images.json").unlink()
    assert main(["--check", "--directory", str(tmp_path)]) == 1
    told = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in told] == [str(poses), str(tmp_path / "images.json")]


def test_the_readme_lists_every_file():
    readme = (FOLDER / "README.md").read_text("utf-8")
    assert all(f"[`{name}`]({name})" in readme for name in FILES)


@every_file
def test_names_are_unique_and_requirements_known(name):
    document = DOCUMENTS[name]
    names = [case["name"] for case in document["cases"]]
    assert len(set(names)) == len(names)
    cited = {case["requirement"] for case in document["cases"] if "requirement" in case}
    cited |= {t["requirement"] for t in document.get("tolerances", {}).values() if "bound" in t}
    assert cited <= set(document["requirements"])
    assert set(document["requirements"]) <= requirements(document["version"]).keys()


@every_file
def test_decimal_and_hexadecimal_are_one_number(name):
    def check(value):
        if isinstance(value, dict) and value.keys() == {"decimal", "hex"}:
            decimals = np.array(value["decimal"], float)
            assert np.array_equal(decimals, doubles(value), equal_nan=True)
            assert (np.signbit(decimals) == np.signbit(doubles(value))).all()
            return 1
        if isinstance(value, dict):
            value = list(value.values())
        return sum(map(check, value)) if isinstance(value, list) else 0

    assert check(DOCUMENTS[name]) > 0 or name == "framing.json"


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


@cases("framing.json")
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


@cases("framing.json")
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
    message = decode_from_client(payload.encode(), "message", said_hello=False)
    assert isinstance(message, CameraPose)
    return message.pose.position[0] if is_text else message.timestamp


@cases("numbers.json", verdict="accepted")
def test_the_wire_reads_the_number(case):
    assert read(case) == float.fromhex(case["value"]["hex"])


@cases("numbers.json", verdict="rejected")
def test_the_wire_rejects_the_spelling(case):
    with pytest.raises(ProtocolError) as caught:
        read(case)
    if case["spelling"][0] == '"':
        # It breaks more than one clause: it is no JSON number, and x has to be a number.
        assert caught.value.pointer == "/position/x"
    else:
        assert caught.value.requirement == case["requirement"]


@cases("numbers.json", verdict="optional")
def test_the_wire_reads_the_string(case):
    assert read(case) == float.fromhex(case["value"]["hex"])


# ---- poses, conventions, images


def assert_near(name, quantity, got, expected):
    measure, bound = tolerance(name, quantity)
    difference = np.array(got, float) - expected
    if measure == "norm":
        assert np.linalg.norm(difference) <= bound * max(1.0, np.linalg.norm(expected))
    else:
        assert measure == "component"
        assert np.abs(difference).max() <= bound


def pose_of(value):
    position, rotation = doubles(value["position"]).tolist(), doubles(value["rotation"]).tolist()
    return Pose(tuple(position), tuple(rotation))


@cases("poses.json")
def test_the_wire_makes_the_matrices(case):
    pose = pose_of(case["pose"])
    expected = {quantity: doubles(value) for quantity, value in case["expected"].items()}
    R = np.reshape(rotation_matrix(pose.rotation), (3, 3))
    view = view_matrix(pose)
    got, right = as_array(view), expected["view_matrix"]
    assert_near("poses.json", "rotation_matrix", R, expected["rotation_matrix"])
    assert_near("poses.json", "view_rotation", got[:3, :3], right[:3, :3])
    assert_near("poses.json", "view_translation", got[:3, 3], right[:3, 3])
    assert got[3].tolist() == right[3].tolist()
    assert_near("poses.json", "camera_centre", camera_centre(view), expected["camera_centre"])


@cases("conventions.json")
def test_the_wire_changes_the_axes(case):
    engine = ENGINES[case["engine"]]
    change = engine.from_wire if case["direction"] == "from_wire" else engine.to_wire
    got, expected = change(pose_of(case["pose"])), pose_of(case["expected"])
    assert got.position == expected.position
    sign = math.copysign(1, np.dot(got.rotation, expected.rotation))
    assert_near("conventions.json", "rotation", sign * np.array(got.rotation), expected.rotation)


def test_the_engines_are_those_of_the_wire():
    for name, stated in DOCUMENTS["conventions.json"]["engines"].items():
        engine = ENGINES[name]
        assert engine.world == tuple(np.ravel(stated["world"]))
        assert engine.camera == tuple(np.ravel(stated["camera"]))
        assert engine.scale == stated["scale"]


@cases("images.json", quantity="depth")
def test_the_wire_finds_the_depth(case):
    d = doubles(case["inverse_depth"]).astype(np.float32)
    alpha = case["alpha"] and doubles(case["alpha"]).astype(np.float32)
    assert planar_depth(d, alpha) == doubles(case["expected"])


@cases("images.json", quantity="composite")
def test_the_wire_composites(case):
    blend = over_straight if case["alpha"] == "straight" else over_premultiplied
    members = ("splat", "splat_depth", "background", "background_depth")
    got = blend(*(doubles(case[member]).astype(np.float32) for member in members))
    expected = doubles(case["expected"])
    measure, bound = tolerance("images.json", "colour")
    assert measure == "ulp_single"
    assert (np.abs(got - expected) <= bound * np.spacing(expected.astype(np.float32))).all()
