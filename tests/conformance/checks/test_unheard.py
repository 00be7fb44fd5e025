"""Checks of clients that say no hello: the miniature of 1.0, as it is, unusual, and broken."""

import shlex
import sys
from pathlib import Path

import pytest
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.plan import Plan

from tests.conformance.images.cuda_stand_in.library import findings_of

MINIATURE = Path(__file__).parents[1] / "miniatures" / "client.py"
LISTENS = "        for _ in packets(sock):\n            pass\n"
ONCE = ("    while True:\n        began", "    for _ in (1,):\n        began")
STAYS = ("    keep(MSG, msg, sys.argv[1])", "    keep(MSG, msg, sys.argv[1])\n    time.sleep(600)")
ONE_A_CONNECTION = """
        read(next(packets(sock))) or os.abort()
        while sock.recv(1 << 16):
            pass
"""
CLOSES_ON_STRANGERS = """
        for it in packets(sock):
            if "meta" not in (read(it) or {}):
                raise Bad("a stranger")
"""
NAMES = {
    "check_bad_length_closes",
    "check_half_packet_is_discarded",
    "check_ignores_what_is_no_init_packet",
    "check_survives_broken_payloads_unheard",
}
CHECKS = {it.name: it for it in checks_of("client") if it.name in NAMES}
COMES_BACK = {"returns:ipc", "reconnects:ipc"}
SEEN_WITHOUT_RETURN = {n: it for n, it in CHECKS.items() if not COMES_BACK & it.needs}


def findings(tmp_path: Path, checks: dict, *changes: tuple[str, str]) -> dict[str, str]:
    source = MINIATURE.read_text("utf-8")
    for old, new in changes:
        assert old in source
        source = source.replace(old, new)
    program = tmp_path / "client.py"
    program.write_text(source, "utf-8")
    command = shlex.join([sys.executable, str(program), "1.0"])
    found = findings_of(Plan("client", command, "127.0.0.1", (0, 0), (64, 48), 2.0), checks)
    return {name: what for name, what in found.items() if what and "skipped" not in what}


def test_the_good_miniature_fails_no_check(tmp_path: Path) -> None:
    assert findings(tmp_path, CHECKS) == {}


def test_one_that_never_comes_back_fails_no_check(tmp_path: Path) -> None:
    assert findings(tmp_path, SEEN_WITHOUT_RETURN, ONCE, STAYS) == {}


@pytest.mark.parametrize(
    ("check", "reason", "changes"),
    [
        (
            "check_bad_length_closes",
            "the testee neither reacted nor went on",
            [(LISTENS, "        while sock.recv(1 << 16):\n            pass\n")],
        ),
        (
            "check_survives_broken_payloads_unheard",
            "the testee died",
            [(LISTENS, "        for it in packets(sock):\n            read(it) or os.abort()\n")],
        ),
        (
            "check_survives_broken_payloads_unheard",
            "the testee died",
            [(LISTENS, ONE_A_CONNECTION), ONCE, STAYS],
        ),
        (
            "check_ignores_what_is_no_init_packet",
            "the testee closed the connection",
            [(LISTENS, CLOSES_ON_STRANGERS)],
        ),
    ],
    ids=["waits", "dies", "dies of the first", "closes"],
)
def test_a_broken_one_fails_for_its_reason(
    check: str, reason: str, changes: list[tuple[str, str]], tmp_path: Path
) -> None:
    assert reason in findings(tmp_path, {check: CHECKS[check]}, *changes)[check]
