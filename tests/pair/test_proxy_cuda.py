"""Programs that share device memory, with a proxy between them: handles pass, and open."""

import shlex
import sys
from pathlib import Path

import pytest
from splatbus_conformance.checks.v1_0.cud import clients as device
from splatbus_conformance.checks.v1_0.cud import servers as served
from splatbus_conformance.observe.audit import audit
from splatbus_conformance.plan import Plan, Side
from splatbus_conformance.wire.recording import load

from tests.conformance.images.cuda_stand_in.library import checks_in, findings_of, library
from tests.zoo import mutants

HERE = Path(__file__).parent
CASES: dict[Side, tuple[list[str], dict[str, object]]] = {
    "client": (["-m", "splatbus_viewer.cli", "view"], checks_in(device)),
    "server": (["-m", mutants.__name__, "server-lends-from-a-device"], checks_in(served)),
}


@pytest.mark.parametrize("side", CASES)
def test_what_a_harness_sees_of_device_memory_is_what_it_sees_without_a_proxy(
    side: Side, tmp_path: Path
) -> None:
    library()
    program, checks = CASES[side]
    behind = [str(HERE / "behind_a_proxy.py"), side, str(tmp_path / "session"), *program]
    command = shlex.join([sys.executable, *behind])
    size = (64, 48) if side == "client" else (0, 0)
    plan = Plan(side, command, "127.0.0.1", (0, 0), size, 10.0, stand_in_cuda=True)
    assert findings_of(plan, checks) == dict.fromkeys(checks, "")
    recorded = [load(file) for file in tmp_path.iterdir()]
    assert any(b"mem_color" in (entry.data or b"") for each in recorded for entry in each)
    broken = [f for each in recorded for f in audit(each).of(side) if f.broken]
    assert broken == []
