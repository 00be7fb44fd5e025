"""A check that could show nothing of a used testee is judged of a fresh one, and again where the
machine kept a testee waiting that failed.
"""

import json
import sys
from pathlib import Path

import pytest
from splatbus_conformance.wire.sockets import Peer

from tests.conformance.harness import said
from tests.conformance.run.test_workers import told

SERVES = """
import os
import sys
from pathlib import Path

from splatbus_renderer.cli import main
from splatbus_server.session import Session

handles = Session.handle


def handle(self, connection, message, now):
    if type(message).__name__ in {hardens_by!r}:
        {then}
    return handles(self, connection, message, now)


Session.handle = handle
STARTS = Path({starts!r})
with STARTS.open("a") as starts:
    starts.write("one more\\n")
sys.exit(main(["--quiet", "--size", "64x48"]))
"""
HARDENS = "self.exchange.memory.ring.clients = 1"
DIES = "len(STARTS.read_text().splitlines()) <= {times} and os._exit(0)"
USED = {"check_one_reply_each_in_order": "pass", "check_shows_it_beside_who_reads_both": "pass"}
ALIKE = {
    "check_keeps_former_memory_for_who_may_open_it": "skip",
    "check_changes_nothing_for_who_cannot_follow": "skip",
}
"""Two that can show nothing for the same reason, of a fresh testee either."""


def judged(then: str, by: str, select: str, tmp_path: Path) -> tuple[dict[str, str], int, str]:
    """The verdict of each check, how often the server was started, and the advice."""
    starts, report = tmp_path / "starts", tmp_path / "report.json"
    program = tmp_path / "server.py"
    program.write_text(SERVES.format(hardens_by=[by], then=then, starts=str(starts)), "utf-8")
    launch = f'"{sys.executable}" "{program}"'
    words = ("--select", select, "--shrink", "0", "--json", str(report))
    said("server", "--launch", launch, "--parallel", "1", *words)
    verdicts = {check: verdict for _, check, verdict in told(report) if check != "rule"}
    advice = json.loads(report.read_text("utf-8"))["advice"]
    return verdicts, len(starts.read_text("utf-8").splitlines()), "".join(advice)


@pytest.mark.parametrize(
    ("hardens_by", "verdicts", "advised"), [("GetCameraPose", USED, True), ("Opened", ALIKE, False)]
)
def test_what_a_check_took_does_not_hide_what_another_shows(
    hardens_by: str, verdicts: dict[str, str], advised: bool, tmp_path: Path
) -> None:
    """The server lets in no second reader once it has heard a message of this kind."""
    seen, starts, advice = judged(HARDENS, hardens_by, ",".join(verdicts), tmp_path)
    assert (seen, starts) == (verdicts, 2)
    assert ("one reader at a time" in advice) == advised


@pytest.mark.parametrize(
    ("kept", "times", "verdict"), [(2, 1, "pass"), (2, 2, "fail"), (0, 1, "fail")]
)
def test_what_was_seen_where_the_machine_was_busy_counts_if_it_is_seen_again(
    kept: float, times: int, verdict: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The machine keeps the check waiting for so many seconds, and the server ends so often."""
    monkeypatch.setattr(Peer, "kept_seconds", lambda self: kept)
    check = "check_one_reply_each_in_order"
    seen, _, advice = judged(DIES.format(times=times), "GetCameraPose", check, tmp_path)
    assert seen == {check: verdict}
    assert ("while the machine kept it waiting" in advice) == (verdict == "pass")
