"""The checks that need an adapter: the reference client passes in all axes."""

import json
import math
import subprocess
import sys
from fractions import Fraction
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks.v1_0.buf import compositing
from splatbus_conformance.checks.v1_0.req import understood
from splatbus_conformance.data import read_json

from tests.conformance.harness import run, said

pytestmark = pytest.mark.apart

AXES = ("opencv", "unity", "unreal", "blender", "opengl", "opengl_camera")
ROWS = {"unity": "CNV-4", "unreal": "CNV-5", "blender": "CNV-6", "opengl": "CNV-7"}
POSES = ["CNV-1", "CNV-2", "CNV-3", *ROWS.values(), "ACC-1", "ACC-7", "REQ-11"]
IMAGES = ["IMG-13", "IMG-14", "IMG-22", "CHN-18", "BUF-8", "BUF-9", "ACC-10", "MEM-13"]


def judged(tmp_path, axes, select):
    """The results at L2 of a run on the reference client, by requirement."""
    path = tmp_path / "report.json"
    done = subprocess.run(
        [
            *(sys.executable, "-m", "splatbus_conformance", "--plain", "client", "--json", path),
            *("--adapter", f'"{sys.executable}" -m splatbus_viewer.adapter --axes {axes}'),
            *("--select", ",".join(select), "--profile", "brief"),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads(path.read_text("utf-8"))
    jsonschema.Draft202012Validator(read_json("report.schema.json")).validate(report)
    return {
        requirement["id"]: results
        for requirement in report["requirements"]
        if (results := [r for r in requirement["results"] if r["assurance"] == "L2"])
    }


@pytest.mark.parametrize("axes", AXES)
def test_the_reference_client_converts_poses_in_all_axes(tmp_path, axes):
    results = judged(tmp_path, axes, POSES)
    others = {row for engine, row in ROWS.items() if engine != axes}
    for name, found in results.items():
        verdicts = {result["verdict"] for result in found}
        assert verdicts == ({"skip"} if name in others else {"pass"}), (name, found)
    for name in ("ACC-1", "ACC-7"):
        for result in results[name]:
            told = {it["quantity"]: it for it in result["measurements"]}
            assert {"position", "quaternion", "angle"} <= set(told)
            assert all(it["beyond"] == 0 for it in told.values())
            assert "position: worst" in result["text"]


def test_a_device_may_know_no_subnormal_numbers():
    tiny, least = 2.0**-140, 2.0**-126
    assert compositing._error((0.0,), (Fraction(tiny),)) == 0
    assert compositing._error((0.0,), (Fraction(least),)) > 3
    assert compositing._error((tiny,), (Fraction(tiny),)) == 0
    flushed = compositing._flush(np.float32([tiny, -tiny, least, 0.5]))
    assert flushed.dtype == np.float32
    assert flushed.tolist() == [0, 0, least, 0.5]


def test_an_image_is_lent_once_the_one_before_has_come_back(tmp_path):
    """The harness's own server keeps IMG-2, which a client may rely on: one that shows no image
    which breaks it would be taken for one that shows nothing.
    """
    command = f'"{sys.executable}" -m splatbus_viewer.adapter'
    folder = tmp_path / "recorded"
    lending = ",".join([*IMAGES, "IMG-12", "EVO-1", "OPN-6", "OPN-10"])
    chosen = ("--select", lending, "--record", str(folder))
    status, told = run("client", "--adapter", command, *chosen, limit=600)
    assert status == 0, told
    recordings = sorted(folder.glob("*.jsonl"))
    assert len(recordings) > 10
    for each in recordings:
        assert "FAIL IMG-2 " not in said("audit", str(each))[1], each.name


def test_of_two_cameras_that_are_next_to_each_other_the_right_one_is_taken():
    """Where positions are scaled, the rounding of a large number hides which of them it was."""
    far, near = 939622.7486641401, -6.918583424999773e-08
    identity = (0.0, 0.0, 0.0, 1.0)
    former = Pose((near, math.nextafter(near, 0.0), far), identity)
    right = Pose((near, near, far), identity)
    reply = {"position": [100 * far, 100 * near, -100 * near], "rotation": [0.0, 0.0, 0.0, 1.0]}
    trial = SimpleNamespace(
        greeting=SimpleNamespace(axes="unreal", units_per_metre=100, single=False),
        role=SimpleNamespace(width=64, height=48),
    )
    answering = SimpleNamespace(possible=lambda index: [former, right])
    taken, error = understood(trial, answering, 0, reply)
    assert (taken, error.position <= 0.5) == (right, True)
