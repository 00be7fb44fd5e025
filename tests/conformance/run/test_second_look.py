"""A check that could show nothing of a used testee is judged of a fresh one."""

import json
import sys
from pathlib import Path

from splatbus_conformance.verdicts import Verdict

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
        self._most_readers = 1
    return handles(self, connection, message, now)


Session.handle = handle
with Path({starts!r}).open("a") as starts:
    starts.write("one more\\n")
sys.exit(main(["--quiet", "--size", "64x48"]))
"""
BEFORE = "check_one_reply_each_in_order"
BESIDE = "check_shows_it_beside_who_reads_both"
ALIKE = (
    "check_keeps_former_memory_for_who_may_open_it",
    "check_changes_nothing_for_who_cannot_follow",
)
"""Two that can show nothing for the same reason."""


def judged(tmp_path: Path, hardens_by: str, *names: str) -> tuple[dict[str, str], list[str], int]:
    """The verdicts on a server that lets in no second reader any more once it has heard a message
    of this kind, what is advised, and how often it was started.
    """
    starts, report = tmp_path / "starts", tmp_path / "report.json"
    program = tmp_path / "server.py"
    program.write_text(SERVES.format(hardens_by=[hardens_by], starts=str(starts)), "utf-8")
    launch = f'"{sys.executable}" "{program}"'
    run("server", "--launch", launch, "--select", ",".join(names), "--json", str(report))
    verdicts = {check: verdict for _, check, verdict in told(report)}
    advice = json.loads(report.read_text("utf-8"))["advice"]
    return verdicts, advice, len(starts.read_text("utf-8").splitlines())


def test_what_a_check_took_does_not_hide_what_another_shows(tmp_path: Path) -> None:
    verdicts, advice, starts = judged(tmp_path, "GetCameraPose", BEFORE, BESIDE)
    assert verdicts[BESIDE] == Verdict.PASS
    assert starts == 2
    assert [it for it in advice if BESIDE in it and "one reader at a time" in it]


def test_what_a_fresh_testee_does_not_show_either_is_not_asked_for_again(tmp_path: Path) -> None:
    verdicts, advice, starts = judged(tmp_path, "Opened", *ALIKE)
    assert verdicts == dict.fromkeys(ALIKE, Verdict.SKIP)
    assert starts == 2
    assert advice == []
