"""What there is to know of a server, printed."""

import re
import threading

import pytest
from splatbus_viewer.cli import main

from tests.peers.fake_server import HEIGHT, SCENE, WIDTH, frame


def answer(message):
    """Answer all questions of a message connection, until it ends; by a clock that is ahead."""
    try:
        while True:
            request = message.receive()
            replies = {
                "get_viewport_size": {"type": "viewport_size", "viewport_size": [WIDTH, HEIGHT]},
                "get_scene": SCENE,
                "ping": {
                    "type": "pong",
                    "t": request.get("t"),
                    "serverTime": request.get("t", 0) + 1000.0,
                },
            }
            message.send(replies[request["type"]] | {"id": request["id"]})
    except EOFError:
        pass


@pytest.mark.usefixtures("where")
def test_a_server_is_described(server, memory, capsys):
    players = [
        threading.Thread(target=lambda: answer(server.message_1_1())),
        threading.Thread(target=lambda: server.ipc_opened(memory).send(frame(7))),
    ]
    for player in players:
        player.start()
    assert main(["info", "--timeout", "20"]) == 0
    for player in players:
        player.join()
    out = capsys.readouterr().out
    for part in (
        "1.1, fake 0",
        "capabilities: intrinsics, objects, ping, scene, telemetry, time, viewport",
        " s ahead of ours, give or take ",
        "objects: 2, cameras: 3, time 0 to 4 s",
        "default (Garden): 1,200,000 Gaussians within (-4, -2, -4) to (4, 1, 4)",
        "chair: 7 Gaussians\n",
        f"{WIDTH}x{HEIGHT}, the newest is number 7, ",
        "straight alpha, srgb colour, planar_z depth (expected), inf where nothing is",
    ):
        assert part in out, part
    assert float(re.search(r"is ([\d.]+) s ahead", out)[1]) == pytest.approx(1000, abs=1)


@pytest.mark.usefixtures("where")
def test_of_a_server_of_1_0_is_told_what_it_can_tell(server, capsys):
    def play():
        message = server.message()
        try:
            while message.receive_type("get_viewport_size"):
                message.send({"viewport_size": [WIDTH, HEIGHT]})
        except EOFError:
            pass

    player = threading.Thread(target=play)
    player.start()
    assert main(["info", "--timeout", "1"]) == 0
    player.join()
    out = capsys.readouterr().out
    assert f"viewport  {WIDTH}x{HEIGHT}" in out
    assert "message   1.0" in out
    assert re.search(r"within [01]\.\d s: .* no images yet: it may still be starting", out)
    assert "capabilities" not in out
