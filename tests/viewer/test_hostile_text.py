"""Whatever a server says, wherever it can say something: nothing of it acts where it is shown."""

import os
import subprocess
import sys
import threading

import pytest
from splatbus_schemas.visible import visible

from tests.peers.fake_server import (
    CAMERA,
    IPC_CAPABILITIES,
    MESSAGE_CAPABILITIES,
    SCENE,
    SEMANTICS,
    frame,
    init_packet,
    welcome,
)

ACTING = "::error::owned\x1b]0;x\x07\x1b[2J\r\n::error::\u202e\x9b1m##[error]\u2028"
assert len(ACTING) <= 60
BROKEN = (
    {"type": ACTING},
    f'{{"{ACTING.encode("unicode_escape").decode()[:20]}": 1}}'.encode(),
    b'{"a\xc2\x9b2J":1,"a\xc2\x9b2J":2}',
    b"\x1b[2J",
    {"type": "error", "code": ACTING, "message": ACTING, "pointer": ACTING},
)


def acting(*capabilities):
    message = welcome(ACTING, *capabilities)
    return message | {"server": {"name": ACTING, "version": ACTING}}


def numbered(count):
    return [f"{ACTING}{number}" for number in range(count)]


def answer(request):
    """What is said to a request, or to nothing."""
    mine = {name: value for name, value in request.items() if name == "id"}
    refusal = {"type": "error", "code": ACTING, "message": ACTING} | mine
    objects = [SCENE["objects"][0] | {"name": ACTING}]
    objects += [{"id": it, "name": ACTING, "gaussians": 1, "bounds": None} for it in numbered(2)]
    kinds = [
        {"kind": "scalar", "value": 1.5, "unit": ACTING},
        {"kind": "histogram", "edges": [0.0, 1.0], "counts": [1]},
        {"kind": "text", "value": ACTING},
        {"kind": ACTING},
    ]
    series = [{"name": name} | kind for name, kind in zip(numbered(4), kinds, strict=True)]
    return {
        "get_viewport_size": [{"type": "viewport_size", "viewport_size": [6, 4]} | mine],
        "get_scene": [SCENE | {"objects": objects} | mine],
        "get_camera_pose": [refusal],
        "set_viewport": [refusal],
        "ping": [{"type": "pong", "t": 0.0, "serverTime": 1.0} | mine],
        "subscribe_telemetry": [
            {"type": "telemetry", "seq": seq, "time": 1.0, "series": series} for seq in (1, 2)
        ],
    }.get(request["type"], [])


def play_message(server):
    message = server.message()
    message.receive()
    message.send(acting(*MESSAGE_CAPABILITIES), *BROKEN)
    try:
        while True:
            message.send(*answer(message.receive()))
    except (EOFError, OSError):
        pass


def play_images(server, memory):
    ipc = server.ipc()
    ipc.receive()
    ipc.send(
        acting(*IPC_CAPABILITIES),
        *BROKEN,
        init_packet(memory.name, 1, semantics=SEMANTICS | {"alpha": ACTING}),
        init_packet(ACTING, 2),
        init_packet(memory.name, 3),
        frame(1, generation=3, camera=CAMERA | {"tag": ACTING}),
        frame(2, generation=3, camera=CAMERA | {"tag": ACTING, "width": 9}),
    )
    try:
        while ipc.receive():
            pass
    except (EOFError, OSError):
        pass


def play_refusal(server, memory):
    ipc = server.ipc()
    ipc.receive()
    ipc.send({"type": "error", "code": "unauthorized", "message": ACTING})
    ipc.close()


@pytest.mark.parametrize(
    ("arguments", "images"),
    [
        (["info", "-v"], play_images),
        (["info", "--timeout", "2"], play_refusal),
        (["view", "-v", "--size", "8x8", "--seconds", "1.5"], play_images),
        (["view", "--seconds", "1"], play_refusal),
        (["telemetry", "--seconds", "1"], play_images),
        (["telemetry", "--json", "--seconds", "1"], play_images),
        (["snapshot", "--camera-index", "1"], play_images),
        (["snapshot", "--timeout", "1"], play_refusal),
    ],
    ids=lambda it: " ".join(it) if isinstance(it, list) else it.__name__,
)
@pytest.mark.usefixtures("where")
def test_no_word_of_a_server_acts(server, memory, tmp_path, arguments, images):
    if arguments[0] == "snapshot":
        arguments = ["snapshot", str(tmp_path / "out.png"), *arguments[1:]]
    players = [
        threading.Thread(target=play_message, args=(server,)),
        threading.Thread(target=images, args=(server, memory)),
    ]
    for player in players:
        player.start()
    done = subprocess.run(
        [sys.executable, "-m", "splatbus_viewer", *arguments],
        env=os.environ | {"PYTHONIOENCODING": "utf-8"},
        capture_output=True,
        check=False,
        timeout=60,
    )
    for player in players:
        player.join()
    said = done.stdout.decode() + done.stderr.decode()
    assert done.returncode in (0, 1), said
    assert "Traceback" not in said
    assert "owned" in said, "it was told"
    assert visible(said, kept="\n") == said
