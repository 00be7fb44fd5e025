"""Figures from the renderer: each kind, to those who asked, and computed for nobody else."""

from __future__ import annotations

import io
import json
import threading

import pytest
import splatbus_client
import splatbus_server
from splatbus_viewer import cli
from splatbus_wire.messages import Histogram, Scalar, Text

from tests.pair.rig import MOST_SECONDS, eventually, served
from tests.pair.talk import Talker


class Counting:
    """A render loop that tells of itself, and counts how often it is asked for each figure."""

    def __init__(self) -> None:
        self.computed = {"scalar": 0, "histogram": 0, "text": 0}

    def loop(self, stopped: threading.Event, bus: splatbus_server.Bus) -> None:
        while not stopped.wait(0.005):
            bus.telemetry(
                scalar=lambda: self._count("scalar", (3.5, "ms")),
                histogram=lambda: self._count("histogram", ([120, 880], [0.0, 0.5, 1.0])),
                text=lambda: self._count("text", "training"),
            )

    def _count(self, name: str, value: object) -> object:
        self.computed[name] += 1
        return value


def test_each_kind_arrives_and_nothing_is_computed_for_nobody() -> None:
    counting = Counting()
    with (
        served(counting.loop, 32, 24) as (_, tap),
        tap.session() as session,
        Talker(tap) as idle,
    ):
        idle.said_since()
        assert set(counting.computed.values()) == {0}
        session.subscribe_telemetry()
        found = session.next_telemetry(MOST_SECONDS)
        assert {type(s): s for s in found.series} == {
            Scalar: Scalar("scalar", 3.5, "ms"),
            Histogram: Histogram("histogram", (0.0, 0.5, 1.0), (120, 880)),
            Text: Text("text", "training"),
        }
        assert idle.said_since() == []  # who has not asked is sent none
        session.subscribe_telemetry(["text"])
        while len(session.next_telemetry(MOST_SECONDS).series) != 1:
            pass
        before = dict(counting.computed)
        for _ in range(3):
            [series] = session.next_telemetry(MOST_SECONDS).series
            assert series == Text("text", "training")
        assert counting.computed["histogram"] <= before["histogram"] + 1
        session.subscribe_telemetry([])
        eventually(lambda: is_silent(session), "the end of it")
        stopped = dict(counting.computed)
        idle.said_since()
        assert counting.computed == stopped
    tap.assert_conforming()


def is_silent(session: splatbus_client.Session) -> bool:
    try:
        session.next_telemetry(0.3)
    except TimeoutError:
        return True
    return False


def test_the_command_prints_it_live(capsys: pytest.CaptureFixture[str]) -> None:
    with served(Counting().loop, 32, 24) as (_, tap):
        ports = ["--ipc-port", str(tap.ports["ipc"]), "--msg-port", str(tap.ports["msg"])]
        assert cli.main(["telemetry", *ports, "--json", "--seconds", "1"]) == 0
        lines = io.StringIO(capsys.readouterr().out).readlines()
        told = [json.loads(line) for line in lines if line.startswith("{")]
        assert len(told) >= 2
        assert {s["kind"] for s in told[0]["series"]} == {"scalar", "histogram", "text"}
        assert cli.main(["telemetry", *ports, "--seconds", "1"]) == 0
        plain = capsys.readouterr().out
        assert "3.5" in plain
        assert "training" in plain
    tap.assert_conforming()
