from __future__ import annotations

import logging

import pytest
from splatbus_server import logs
from splatbus_server.logs import Sparing


def test_lines_of_a_kind_are_left_out_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "LINES_A_SECOND", 3)
    now = [0.0]
    monkeypatch.setattr(logs.time, "monotonic", lambda: now[0])
    written = []

    def write(words: str, *given: object) -> None:
        record = logging.LogRecord("", logging.INFO, "", 0, words, given, None)
        if filtering.filter(record):
            written.append(record.getMessage())

    filtering = Sparing()
    for number in range(9):
        write("%s: refused", number)
    write("another %s", "kind")
    now[0] = 1.0
    write("%s: refused", "100%")
    write("%s: refused", 10)
    assert written == [
        *("0: refused", "1: refused", "2: refused", "another kind"),
        *("100%: refused (6 like it left out)", "10: refused"),
    ]


def test_what_a_client_says_does_not_act_in_the_log() -> None:
    record = logging.LogRecord(
        "", logging.INFO, "", 0, "%s: %s", ("msg", "a\x9b2J\n::error::"), None
    )
    Sparing().filter(record)
    assert record.getMessage() == "msg: a\\x9b2J\\x0a::error::"
