"""The vectors are what the oracle makes, and what their schema allows."""

import json
import struct

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from splatbus_conformance.oracle.vectors.__main__ import FILES, main
from splatbus_schemas import requirements

from tests.spec.vector_files import DOCUMENTS, FOLDER, cases, doubles, is_near

VALIDATOR = Draft202012Validator(json.loads((FOLDER / "vectors.schema.json").read_text("utf-8")))
every_file = pytest.mark.parametrize("name", DOCUMENTS)


@every_file
def test_the_file_is_what_its_schema_allows(name):
    VALIDATOR.check_schema(VALIDATOR.schema)
    assert [error.message for error in VALIDATOR.iter_errors(DOCUMENTS[name])] == []


def test_the_schema_tells_wrong_files():
    broken = json.loads(json.dumps(DOCUMENTS["poses"]))
    broken["cases"][3]["pose"]["rotation"]["hex"].pop()
    assert not VALIDATOR.is_valid(broken)
    assert not VALIDATOR.is_valid({**DOCUMENTS["numbers"], "name": "framing"})


def test_the_folder_holds_what_the_oracle_makes(capsys):
    assert main(["--check", "--directory", str(FOLDER)]) == 0
    assert capsys.readouterr().out == ""
    assert {path.name for path in FOLDER.glob("*.json")} == {
        *FILES,
        "packets.json",
        "vectors.schema.json",
    }


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
    assert all(f"[`{name}`]({name})" in readme for name in (*FILES, "packets.json"))


@every_file
def test_names_are_unique_and_requirements_known(name):
    document = DOCUMENTS[name]
    names = [case["name"] for case in document["cases"]]
    assert len(set(names)) == len(names)
    version = document["version"]
    cited = {(t.get("requirement"), version) for t in document.get("tolerances", {}).values()}
    cited |= {(case.get("requirement"), case.get("since", version)) for case in document["cases"]}
    for requirement, needed in cited - {(None, version)}:
        assert requirement in document["requirements"]
        assert requirement in requirements(needed)
    assert set(document["requirements"]) <= requirements("1.1").keys()


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

    assert check(DOCUMENTS[name]) > 0 or name in ("framing", "packets")


def every_number(value):
    """Each number, vector or matrix of a document with its path."""
    if isinstance(value, dict) and value.keys() == {"decimal", "hex"}:
        yield (), value
    elif isinstance(value, dict | list):
        members = value.items() if isinstance(value, dict) else enumerate(value)
        for name, member in members:
            for path, number in every_number(member):
                yield (name, *path), number


@every_file
def test_nothing_that_is_expected_is_nan(name):
    for case in DOCUMENTS[name]["cases"]:
        for path, number in every_number(case.get("expected", {})):
            assert not np.isnan(doubles(number)).any(), (case["name"], path)


@pytest.mark.parametrize("name", ["images", "projections"])
def test_what_is_said_to_be_single_precision_is(name):
    loose = {"expected", "intrinsics"}
    for case in DOCUMENTS[name]["cases"]:
        for path, number in every_number(case):
            if path[0] not in loose:
                given = doubles(number)
                narrow = given.astype(np.float32)
                assert np.array_equal(narrow, given, equal_nan=True), (case["name"], path)


def test_every_measure_quantity_and_estimator_of_the_readme_is_used_and_explained():
    readme = (FOLDER / "README.md").read_text("utf-8")
    for document in DOCUMENTS.values():
        words = {entry["measure"] for entry in document.get("tolerances", {}).values()}
        words |= {
            case[member]
            for case in document["cases"]
            for member in ("quantity", "verdict", "outcome", "estimator", "direction")
            if member in case
        }
        assert [word for word in words if f"`{word}`" not in readme] == []


def test_near_is_what_the_readme_says():
    assert is_near("images", "colour", 1.0 + 2**-22, 1.0)
    assert not is_near("images", "colour", 1.0 + 2**-21, 1.0)
    assert is_near("images", "colour", 2**-148, 0.0)
    assert not is_near("images", "colour", 2**-147, 0.0)
    assert is_near("conventions", "rotation", (-0.5, 0.5, 0.5, 0.5), (0.5, -0.5, -0.5, -0.5))
    assert not is_near("conventions", "rotation", (-0.5, -0.5, 0.5, 0.5), (0.5, -0.5, -0.5, -0.5))
    assert is_near("poses", "view_translation", (2e6 + 1e-9, 0, 0), (2e6, 0, 0))
    assert not is_near("poses", "view_translation", (1 + 1e-9, 0, 0), (1, 0, 0))
    assert is_near("images", "depth", np.inf, np.inf)
    for quantity in DOCUMENTS["images"]["tolerances"]:
        assert not is_near("images", quantity, np.nan, 1.0)


@cases("packets")
def test_a_packet_is_the_length_of_its_payload_and_the_payload(case):
    packet, payload = bytes.fromhex(case["hex"]), case["payload"].encode()
    assert packet == struct.pack("<I", len(payload)) + payload
