"""No check passes a testee that answers everything alike, or dies soon: what passes is told here.

As in `test_no_pass_without_evidence`, each check is run as if the testee had shown all that the
reference shows.
"""

import contextlib
import json
import socket
import threading
from typing import Any

import pytest
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.plan import Side
from splatbus_conformance.run.testbed import Testbed
from splatbus_conformance.trials.testee.process import Ended
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import CHANNELS, Peer
from splatbus_schemas.requirements import requirements

from tests.conformance.checks.test_no_pass_without_evidence import (
    SEEN_FROM_AFAR,
    SHORT_SECONDS,
    Nothing,
    _listen,
    met,
    outcome,
)

pytestmark = pytest.mark.apart

__all__ = ["met"]
ERROR = {"type": "error", "code": "internal", "message": "no"}
SAID_HELLO = {
    "check_names_the_first_version_that_it_speaks",
    "check_grants_what_both_have",
    "check_any_segmentation",
    "check_half_packet_is_discarded",
    "check_handles_the_next_packet",
    "check_further_ipc_connections_are_not_left_waiting",
    "check_the_longest_hello",
    "check_answers_a_hello_that_comes_late",
}
"""About hello alone: who says welcome as it should, and nothing more, passes these."""


class Alike(Nothing):
    """A server that says welcome or an error to everything, and ends at the nth connection."""

    def __init__(self, peer: Peer, welcome: Any, *, last: int) -> None:
        super().__init__(peer, "server", dies=False)
        self.lock = threading.RLock()
        self.welcome, self.last, self.came = welcome, last, 0

    def ensure_running(self) -> bool:
        with self.lock:
            if self.listeners:
                return False
            self.dead, self.came = False, 0
            for channel in CHANNELS:
                listener = _listen((self.peer.host, self.peer.ports[channel]))
                self.listeners.append(listener)
                threading.Thread(target=self._accept, args=(listener, channel), daemon=True).start()
            return True

    def ended(self) -> Ended | None:
        with self.lock:  # not between the end of its connections and its own
            return super().ended()

    def stop(self) -> None:
        with self.lock:
            for each in self.open:
                with contextlib.suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)
            super().stop()

    def _accept(self, listener: socket.socket, channel: str) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = listener.accept()
                with self.lock:
                    if listener not in self.listeners:
                        connection.close()
                        return
                    self.open.append(connection)
                    self.came += 1
                    if self.came == self.last:
                        self.stop()
                        self.dead = True
                        return
                answer = threading.Thread(target=self._answer, args=(connection, channel))
                answer.daemon = True
                answer.start()

    def _answer(self, connection: socket.socket, channel: str) -> None:
        with contextlib.suppress(OSError), connection.makefile("rb") as stream:
            while header := stream.read(4):
                said: Json = {}
                with contextlib.suppress(ValueError):
                    said = json.loads(stream.read(int.from_bytes(header, "little")))
                answer = self._to(said if isinstance(said, dict) else {}, channel)
                if answer is not None:
                    connection.sendall(packet(encode(answer)))
            connection.close()

    def _to(self, said: Json, channel: str) -> Json | None:
        if self.welcome is None:
            return ERROR
        offered = said.get("capabilities")
        if said.get("type") != "hello" or not isinstance(offered, list):
            return None
        welcome = self.welcome[channel]
        return welcome | {"capabilities": [it for it in welcome["capabilities"] if it in offered]}


@pytest.mark.filterwarnings("ignore")  # as where checks run
@pytest.mark.parametrize("met", ["server"], indirect=True)
@pytest.mark.parametrize(
    ("welcomes", "last", "passes"),
    [(False, 0, set()), (True, 0, SAID_HELLO), (True, 2, set())],
    ids=["errors", "welcomes", "dies at the second"],
)
def test_no_check_passes_a_server_that_answers_everything_alike(
    met: Testbed,
    welcomes: bool,
    last: int,
    passes: set[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    side: Side = "server"
    alike = Alike(met.peer, met.facts.welcome if welcomes else None, last=last)
    monkeypatch.setattr(met, "testee", alike)
    wrong = set()
    for check in checks_of(side):
        if check.name in SEEN_FROM_AFAR:
            continue
        if check.lacks(met.facts):
            continue
        alike.ensure_running()  # only the check is to meet it
        trial = met.trial(requirements("1.1")[check.requirement])
        trial.patience = SHORT_SECONDS
        if (said := outcome(check.play, trial)) != "says so" and not trial.losses:
            wrong.add(said)
        alike.stop()
    assert wrong <= {f"{name} passes" for name in passes}
