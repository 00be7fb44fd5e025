"""What the telemetry command prints, on a terminal and elsewhere."""

import io
import json
import threading

import pytest
from splatbus_schemas.visible import visible
from splatbus_viewer import telemetry
from splatbus_viewer.cli import main
from splatbus_wire.messages import Histogram, Scalar, Telemetry, Text

from tests.peers.fake_server import TELEMETRY

FIGURES = Telemetry(
    17,
    1041.25,
    (
        Scalar("render_ms", 3.5, "ms"),
        Histogram("opacity", (0.0, 0.5, 1.0), (120, 880)),
        Text("stage", "training"),
    ),
)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def shown(out, *messages):
    show = telemetry.as_text(out)
    for message in messages:
        show(message)
    return out.getvalue()


def newest(text):
    """The lines that a terminal shows last."""
    return text.split("\x1b[J")[-1].splitlines()


def test_lines_begin_with_the_server_s_time_and_the_series_name():
    assert shown(io.StringIO(), FIGURES).splitlines() == [
        "1041.250 render_ms 3.5 ms",
        "1041.250 opacity 1000 counted 0 |▁█| 1",
        "1041.250 stage training",
    ]


def test_a_terminal_shows_a_table_in_place():
    written = shown(Terminal(), FIGURES, FIGURES._replace(seq=18))
    assert "\x1b[4F" in written, "the four lines of the first are written over"
    assert newest(written) == [
        "telemetry 18, 1041.250 s on the server's clock",
        "  render_ms        3.5 ms  ▄▄ 3.5",
        "  opacity    1000 counted  0 |▁█| 1",
        "  stage                    training",
    ]


def test_numbers_show_their_course_and_series_that_are_left_out_stay():
    messages = [
        FIGURES._replace(seq=seq, series=(Scalar("loss", value),))
        for seq, value in enumerate([0.0, 4.0, 2.0])
    ]
    rows = newest(shown(Terminal(), FIGURES, *messages))
    assert rows[-1].split() == ["loss", "2", "▁█▄", "0", "to", "4"]
    assert "3.5 ms" in rows[1]


def test_many_bins_are_added_up_to_as_many_as_fit():
    edges, counts = tuple(map(float, range(1025))), (1,) * 1024
    row = newest(shown(Terminal(), FIGURES._replace(series=(Histogram("h", edges, counts),))))[-1]
    assert row.split() == ["h", "1024", "counted", "0", "|" + "█" * 32 + "|", "1024"]


def test_a_histogram_of_nothing_is_empty():
    series = (Histogram("h", (0.0, 1.0), (0,)),)
    assert "0 counted 0 | | 1" in shown(io.StringIO(), FIGURES._replace(series=series))


def test_numbers_may_be_as_large_as_they_can_be():
    messages = [
        FIGURES._replace(seq=seq, series=(Scalar("loss", value),))
        for seq, value in enumerate([-1.7e308, 0.0, 1.7e308])
    ]
    rows = newest(shown(Terminal(), *messages))
    assert rows[-1].split() == ["loss", "1.7e+308", "▁▄█", "-1.7e+308", "to", "1.7e+308"]


def test_a_server_that_ever_has_new_series_fills_no_memory(monkeypatch):
    monkeypatch.setenv("LINES", "1000")
    messages = [
        FIGURES._replace(seq=seq, series=tuple(Scalar(f"{seq}.{i}", 1.0) for i in range(200)))
        for seq in range(3)
    ]
    rows = newest(shown(Terminal(), *messages))[1:]
    assert len(rows) == 256
    assert [row.split()[0] for row in rows[-200:]] == [f"2.{i}" for i in range(200)]


def test_json_is_what_was_on_the_wire():
    out = io.StringIO()
    telemetry.as_json(out)(FIGURES)
    assert json.loads(out.getvalue()) == TELEMETRY
    assert out.getvalue().count("\n") == 1
    out = io.StringIO()
    strange = "\x9b \u202e µ ###[error] \\##vso[a]"
    telemetry.as_json(out)(FIGURES._replace(series=(Text("stage", strange),)))
    assert json.loads(out.getvalue())["series"][0]["value"] == strange
    assert visible(out.getvalue().rstrip()) == out.getvalue().rstrip()


@pytest.fixture
def where(server, monkeypatch):
    monkeypatch.setenv("SPLATBUS_IPC_PORT", str(server.ipc_port))
    monkeypatch.setenv("SPLATBUS_MSG_PORT", str(server.message_port))


@pytest.mark.usefixtures("where")
def test_the_command_subscribes_prints_and_ends(server, capsys):
    subscribed = []

    def play():
        message = server.message_1_1()
        subscribed.append(message.receive_type("subscribe_telemetry")["names"])
        message.send(TELEMETRY, TELEMETRY | {"seq": 18})

    player = threading.Thread(target=play)
    player.start()
    assert main(["telemetry", "--json", "--seconds", "1", "stage", "opacity"]) == 0
    player.join()
    lines = capsys.readouterr().out.splitlines()
    assert [json.loads(line)["seq"] for line in lines] == [17, 18]
    assert subscribed == [["opacity", "stage"]]


@pytest.mark.usefixtures("where")
def test_a_server_without_telemetry_is_said_to_have_none(server, capsys):
    player = threading.Thread(target=lambda: server.message_1_1(capabilities=()))
    player.start()
    assert main(["telemetry"]) == 1
    player.join()
    assert "'telemetry'" in capsys.readouterr().err


def test_a_name_that_is_too_long_is_refused(capsys):
    assert main(["telemetry", "x" * 65]) == 1
    assert "TEL-1" in capsys.readouterr().err
