"""The harness with real handles: the references pass, and those with a defect fail for it (L3)."""

from __future__ import annotations

import shlex
import sys
from dataclasses import replace

import pytest
from splatbus_conformance.checks.v1_0.buf import clients as events
from splatbus_conformance.checks.v1_0.buf import servers as images
from splatbus_conformance.checks.v1_0.cud import clients as device
from splatbus_conformance.checks.v1_1 import opn
from splatbus_conformance.checks.v1_1.img import reading
from splatbus_conformance.checks.v1_1.mem import device as device_opening
from splatbus_conformance.plan import Plan

from tests.conformance.harness import run
from tests.conformance.images.cuda_stand_in.library import checks_in, findings_of
from tests.gpu import require_gpu
from tests.zoo import judge
from tests.zoo.mutants.device import shown
from tests.zoo.registry import mutants

require_gpu()

CLIENT = {
    name: check
    for name, check in checks_in(events, device, opn, reading).items()
    if check.side == "client" and "device" in check.needs
}
SERVER = checks_in(device_opening, images)


def command(module: str, *arguments: str) -> str:
    return shlex.join([sys.executable, "-m", module, *arguments])


def of_client(program: str, checks: dict[str, object]) -> dict[str, str]:
    plan = Plan("client", None, "127.0.0.1", (0, 0), (64, 48), 20.0, adapter=program)
    return findings_of(plan, checks)


def of_server(program: str, checks: dict[str, object]) -> dict[str, str]:
    return findings_of(Plan("server", program, "127.0.0.1", (0, 0), (0, 0), 20.0), checks)


def test_the_reference_client_conforms():
    assert of_client(command("splatbus_viewer.adapter"), CLIENT) == dict.fromkeys(CLIENT, "")


OPENS_NOTHING = {"check": "check_goes_on_without_device_memory", "code": "accepts"}
"""Of a device that is not there: the stand-in tells nobody its UUID."""
BROKEN = [it for it in mutants() if it.alter.__module__ == shown.__name__]
"""What shows by pixels alone: calls are seen of the stand-in only."""
BROKEN += [
    replace(it, requirement="INI-13", **OPENS_NOTHING)
    for it in BROKEN
    if it.name == "shows-what-lies-on-no-device"
]


@pytest.mark.parametrize("mutant", BROKEN, ids=lambda it: f"{it.name}-{it.check}")
def test_a_client_with_a_defect_is_failed(mutant, monkeypatch):
    monkeypatch.setattr(judge, "OPTIONS", {})
    judged = judge.judge(mutant)
    assert judged.fate is judge.Fate.KILLED, judged


def test_the_reference_server_conforms():
    found = of_server(command("tests.gpu.demo_server"), SERVER)
    assert found == dict.fromkeys(SERVER, "")


@pytest.mark.parametrize(
    ("defect", "check", "why"),
    [
        ("another-device", "check_announces_device_memory_that_is_there", "cannot be opened"),
        ("upside-down", "check_rows_are_bottom_up", ""),
    ],
)
def test_a_server_with_a_defect_is_failed(defect, check, why):
    found = of_server(command("tests.gpu.demo_server", defect), {check: SERVER[check]})[check]
    assert found
    assert not found.startswith("skipped")
    assert why in found


def test_several_are_judged_at_a_time():
    """Each by a process of its own: the one that met the testee has the driver in it by then."""
    launch = command("tests.gpu.demo_server")
    words = ("--select", ",".join(SERVER), "--parallel", "2", "--require-level", "L3")
    code, output = run("server", "--launch", launch, *words)
    assert code == 0, output
