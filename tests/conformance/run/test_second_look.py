"""A check that could show nothing of a used testee is judged of a fresh one."""

import json
import sys
from pathlib import Path

import pytest

from tests.conformance.harness import run
from tests.conformance.run.test_workers import told

SERVES = """
import sys
from pathlib import Path

from splatbus_renderer.cli import main
from splatbus_server.session import Session

handles = Session.handle


def handle(self, connection, message, now):
    if type(message).__name__ in {hardens_by!r}:
        self.exchange.memory.ring.clients = 1
    return handles(self, connection, message, now)


Session.handle = handle
with Path({starts!r}).open("a") as starts:
    starts.write("one more\\n")
sys.exit(main(["--quiet", "--size", "64x48"]))
"""
USED = {"check_one_reply_each_in_order": "pass", "check_shows_it_beside_who_reads_both": "pass"}
ALIKE = {
    "check_keeps_former_memory_for_who_may_open_it": "skip",
    "check_changes_nothing_for_who_cannot_follow": "skip",
}
"""Two that can show nothing for the same reason, of a fresh testee either."""


@pytest.mark.parametrize(
    ("hardens_by", "verdicts", "advised"), [("GetCameraPose", USED, 1), ("Opened", ALIKE, 0)]
)
def test_what_a_check_took_does_not_hide_what_another_shows(
    hardens_by: str, verdicts: dict[str, str], advised: int, tmp_path: Path
) -> None:
    """The server lets in no second reader once it has heard a message of this kind."""
    starts, report = tmp_path / "starts", tmp_path / "report.json"
    program = tmp_path / "server.py"
    program.write_text(SERVES.format(hardens_by=[hardens_by], starts=str(starts)), "utf-8")
    launch = f'"{sys.executable}" "{program}"'
    run("server", "--launch", launch, "--select", ",".join(verdicts), "--json", str(report))
    assert {check: verdict for _, check, verdict in told(report) if check != "rule"} == verdicts
    assert len(starts.read_text("utf-8").splitlines()) == 2
    advice = json.loads(report.read_text("utf-8"))["advice"]
    assert ["one reader at a time" in it for it in advice] == [True] * advised
