"""One side of a recording, played again to whoever is on the other side."""

import socket
import sys
import threading
from collections import Counter
from pathlib import Path

import pytest
from splatbus_conformance.cli.commands import replay
from splatbus_conformance.cli.parsing import parser
from splatbus_conformance.observe import playback
from splatbus_conformance.observe.playback import play, steps
from splatbus_conformance.plan import Usage
from splatbus_conformance.reports.console import console
from splatbus_conformance.trials.testee.process import Awaited
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Entry, load
from splatbus_conformance.wire.saving import save
from splatbus_conformance.wire.sockets import Peer

RECORDINGS = Path(__file__).parents[2] / "data" / "recordings"
MOST_SECONDS = 20.0
ASK = packet(encode({"type": "get_viewport_size"}))
SIZE = packet(encode({"viewport_size": [64, 48]}))
POSE = packet(
    encode({"type": "camera_pose", "position": dict.fromkeys("xyz", 0.0), "rotation": {"x": 0.0}})
)

RECORDED = [
    Entry(5.0, "msg", 7, event="open"),
    Entry(5.0, "msg", 7, "c2s", ASK[:3]),
    Entry(5.0, "msg", 7, "c2s", ASK[3:]),
    Entry(5.1, "msg", 7, "s2c", SIZE),
    Entry(5.2, "msg", 7, "c2s", ASK),
    Entry(5.3, "msg", 7, "s2c", SIZE),
    Entry(5.3, "msg", 7, "c2s", event="eof"),
]


class Server:
    """Answers each question, or none, on the message channel; keeps what it heard each time."""

    def __init__(self, *, answers: bool = True) -> None:
        self.heard: list[bytes] = []
        self.ended = threading.Event()
        self._answers = answers
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with self._listener:
            connection, _ = self._listener.accept()
        data = b""
        with connection:
            while piece := connection.recv(65536):
                self.heard.append(piece)
                data += piece
                while self._answers and len(data) >= len(ASK):
                    data = data[len(ASK) :]
                    connection.sendall(SIZE)
        self.ended.set()


def played_to(server: Server, entries: list[Entry]) -> playback.Played:
    peer = Peer("127.0.0.1", {"ipc": server.port, "msg": server.port}, plays="client")
    played = play(steps(entries, "server"), peer, Awaited("the server"), MOST_SECONDS)
    assert server.ended.wait(MOST_SECONDS)
    peer.close()
    return played


def test_a_step_knows_what_had_been_heard_before_it_and_when_it_was() -> None:
    """Of what is waited for: frames and poses come all the time."""
    frame = Entry(5.15, "ipc", 1, "s2c", packet(encode({"type": "frame", "seq": 1})))
    entries = sorted([*RECORDED, frame], key=lambda entry: entry.t)
    _, first, rest, again, end = steps(entries, "server")
    assert again.heard.total() == 1
    assert first.heard == rest.heard == Counter({("msg", 0): 0})
    assert again.heard == Counter({("msg", 0): 1})
    assert (again.pause, end.pause) == pytest.approx((0.2, 0.1))


def test_a_client_is_played_in_turn_with_the_server() -> None:
    server = Server()
    played = played_to(server, RECORDED)
    assert (played.steps, played.delivered, played.missed) == (5, 5, ())
    assert b"".join(server.heard) == ASK + ASK
    assert len(server.heard) >= 2, "the second question waits for the first answer"


def test_an_answer_that_does_not_come_is_told_and_waited_for_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(playback, "TURN_SECONDS", 0.2)
    played = played_to(Server(answers=False), RECORDED)
    assert played.delivered == 5
    assert played.missed == (
        "message 1 of the server on connection 1, msg",
        "message 2 of the server on connection 1, msg",
    )


def test_a_connection_that_does_not_come_is_told_and_the_rest_goes_on() -> None:
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    peer.listen("msg")
    client = socket.create_connection(("127.0.0.1", peer.ports["msg"]), timeout=MOST_SECONDS)
    init = [Entry(0.0, "ipc", 1, event="open"), Entry(0.1, "ipc", 1, "s2c", b"init")]
    given = steps([*init, Entry(0.2, "msg", 1, "s2c", SIZE)], "client")
    played = play(given, peer, Awaited("the client"), 0.2)
    assert played.missed == ("connection 1 on ipc",)
    assert client.recv(len(SIZE)) == SIZE
    client.close()
    peer.close()


def replayed(file: Path, *words: str) -> int:
    arguments = parser().parse_args(["--plain", "replay", str(file), *words])
    return replay(arguments, console(True))


def test_what_was_broken_then_is_found_again_or_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "session.jsonl"
    entries = load(RECORDINGS / "python-client.jsonl")[:6]
    save([*entries, Entry(0.6, "msg", 1, "c2s", POSE)], file)
    view = f'"{sys.executable}" -m splatbus_viewer view'
    mutant = f'"{sys.executable}" -m tests.zoo.mutants rotation-without-w view'
    kept = tmp_path / "kept"
    assert replayed(file, "client", "--launch", mutant, "--record", str(kept)) == 1
    assert "\nAGAIN  POS-1" in capsys.readouterr().out
    assert b"rotation" in b"".join(e.data or b"" for e in load(kept / "session.jsonl"))
    assert replayed(file, "client", "--launch", view) == 0
    assert "\nNOT AGAIN  POS-1" in capsys.readouterr().out


def test_what_cannot_be_played_is_explained(tmp_path: Path) -> None:
    file = tmp_path / "session.jsonl"
    save([Entry(0.0, "msg", 1, "c2s", ASK)], file)
    for words, told in (([], "client --launch CMD"), (["client"], "the server sends nothing")):
        with pytest.raises(Usage, match=told):
            replayed(file, *words, "--launch", "x")
