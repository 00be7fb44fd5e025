"""What the telemetry command prints."""

import io
import json
import threading

import pytest
from splatbus_schemas.visible import visible
from splatbus_viewer import telemetry
from splatbus_viewer.cli import main
from splatbus_wire.messages import Histogram, Text, decode_from_server_message

from tests.peers.fake_server import TELEMETRY

FIGURES = decode_from_server_message(json.dumps(TELEMETRY).encode(), None)


def histogram(*counts):
    return Histogram("h", tuple(map(float, range(len(counts) + 1))), counts)


def test_lines_begin_with_the_server_s_time_and_the_series_name():
    out, bins = io.StringIO(), [histogram(0), histogram(*[1] * 1023), histogram(0, 1, 1000)]
    telemetry.as_text(out)(FIGURES._replace(series=(*FIGURES.series, *bins)))
    assert out.getvalue().splitlines() == [
        "1041.250 render_ms 3.5 ms",
        "1041.250 opacity 1000 counted 0 |▁█| 1",
        "1041.250 stage training",
        "1041.250 h 0 counted 0 | | 1",
        f"1041.250 h 1023 counted 0 |{'█' * 32}| 1023",
        "1041.250 h 1001 counted 0 | ▁█| 3",
    ]


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
