"""No check passes a testee that does nothing: that is deaf, answers everything alike, or dies.

Each check of the harness is run as if the testee had shown all that the reference shows, and each
wait is cut short: what does nothing does not do more of it in five seconds.
"""

import contextlib
import json
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.plan import Plan, Side
from splatbus_conformance.run.options import LAUNCH_PATIENCE
from splatbus_conformance.run.testbed import Testbed, set_up
from splatbus_conformance.trials.testee.adapter import AdapterBroken
from splatbus_conformance.trials.testee.process import Ended
from splatbus_conformance.trials.trial import NotObservable, Trial, Violation
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import CHANNELS, Channel, Peer
from splatbus_schemas.requirements import requirements

pytestmark = pytest.mark.apart

REFERENCE: dict[Side, str] = {
    "client": f'"{sys.executable}" -m splatbus_viewer view',
    "server": f'"{sys.executable}" -m splatbus_renderer --quiet --size 64x48',
}
SHORT_SECONDS = 0.03
SEEN_FROM_AFAR = {"check_host_and_ports_can_be_set", "check_listens_on_loopback_alone"}
"""To connect, or to listen, where it was told to is all that these ask for."""


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
Answer = Callable[[Json, Channel], Json | None]


class Nothing:
    """A testee that only connects, or accepts and answers alike; it ends at the nth connection."""

    name, argv, group, started, expendable = "nothing", (), None, 0.0, True
    greeting = None

    def __init__(self, peer: Peer, side: Side, answer: Answer | None = None, last: int = 0) -> None:
        self.peer, self.side, self.answer, self.last = peer, side, answer, last
        self.lock = threading.RLock()
        self.open: list[socket.socket] = []
        self.listeners: list[socket.socket] = []
        self.dead, self.came = False, 0

    def ensure_running(self) -> bool:
        with self.lock:
            if self.open or self.listeners:
                return False
            self.dead, self.came = False, 0
            for channel in CHANNELS:
                address = self.peer.host, self.peer.ports[channel]
                if self.side == "client":
                    with contextlib.suppress(OSError):
                        self._has_met(socket.create_connection(address, SHORT_SECONDS))
                else:
                    self.listeners.append(listener := _listen(address))
                    _beside(self._accept, listener, channel)
            return True

    def ended(self) -> Ended | None:
        with self.lock:  # not between the end of its connections and its own
            return Ended(-11, crashed=True) if self.dead else None

    def stop(self) -> Ended | None:
        with self.lock:
            for each in (*self.listeners, *self.open):
                with contextlib.suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)
                each.close()
            self.open, self.listeners, self.dead = [], [], False
        return None

    def add_to_environment(self, added: Any) -> None:
        self.stop()

    def output(self) -> str:
        return ""

    def missed(self, channel: str) -> None:
        pass

    def asked_to_start(self, what_for: str) -> bool:
        return True

    def close(self) -> None:
        self.stop()

    def _accept(self, listener: socket.socket, channel: Channel) -> None:
        while True:
            connection, _ = listener.accept()
            with self.lock:
                if listener not in self.listeners or not self._has_met(connection):
                    connection.close()
                    return
            if self.answer:
                _beside(self._serve, connection, channel, self.answer)

    def _has_met(self, connection: socket.socket) -> bool:
        """False for the last, of which it dies."""
        self.open.append(connection)
        self.came += 1
        if self.came == self.last:
            self.stop()
            self.dead = True
        return not self.dead

    def _serve(self, connection: socket.socket, channel: Channel, answer: Answer) -> None:
        with connection.makefile("rb") as stream:
            while header := stream.read(4):
                said: Any = {}
                with contextlib.suppress(ValueError):
                    said = json.loads(stream.read(int.from_bytes(header, "little")))
                reply = answer(said if isinstance(said, dict) else {}, channel)
                if reply is not None:
                    connection.sendall(packet(encode(reply)))
        connection.close()


def _beside(function: Callable[..., None], *given: Any) -> None:
    """Run it in a thread, until a connection ends."""

    def run() -> None:
        with contextlib.suppress(OSError):
            function(*given)

    threading.Thread(target=run, daemon=True).start()


def _listen(address: tuple[str, int]) -> socket.socket:
    """Listen where the one before may just have stopped to."""
    deadline = time.monotonic() + 5.0
    while True:
        try:
            return socket.create_server(address, backlog=128)
        except OSError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.001)


@pytest.fixture(scope="module")
def met(request: pytest.FixtureRequest) -> Iterator[Testbed]:
    """A stand that has met the reference, and has nobody to judge yet."""
    side = request.param
    size = (64, 48) if side == "client" else (0, 0)
    plan = Plan(side, REFERENCE[side], "127.0.0.1", (0, 0), size, LAUNCH_PATIENCE)
    testbed = set_up(plan)
    testbed.introduce()
    testbed.testee.stop()
    hurry(testbed.peer)
    yield testbed
    testbed.close()


def hurry(peer: Peer) -> None:
    """Cut every wait short."""
    until, pump = peer.until, peer.pump

    def soon(condition: Callable[[], Any], seconds: float) -> Any:
        return until(condition, min(seconds, SHORT_SECONDS))

    def briefly(seconds: float = 0.0) -> None:
        pump(min(seconds, SHORT_SECONDS))

    peer.until, peer.pump = soon, briefly  # type: ignore[method-assign, assignment]


def welcomes(met: Testbed) -> Answer:
    """Says welcome as the reference does."""

    def answer(said: Json, channel: Channel) -> Json | None:
        offered, welcome = said.get("capabilities"), met.facts.welcome[channel]
        if said.get("type") != "hello" or not isinstance(offered, list):
            return None
        return welcome | {"capabilities": [it for it in welcome["capabilities"] if it in offered]}

    return answer


ENDS: dict[str, tuple[Callable[[Testbed], Answer | None], int, set[str]]] = {
    "deaf": (lambda met: None, 0, set()),
    "dies at the second": (lambda met: None, len(CHANNELS), set()),
    "errs": (lambda met: lambda *_: ERROR, 0, set()),
    "welcomes": (welcomes, 0, SAID_HELLO),
    "welcomes, and dies at the second": (welcomes, 2, set()),
}
"""How each answers, at which connection it dies, and which checks it passes."""
CASES = [("client", "deaf"), ("client", "dies at the second"), *(("server", it) for it in ENDS)]


@pytest.mark.filterwarnings("ignore")  # as where checks run
@pytest.mark.parametrize(("met", "how"), CASES, indirect=["met"])
def test_no_check_passes_a_testee_that_does_nothing(
    met: Testbed, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    side: Side = "client" if "Client" in type(met).__name__ else "server"
    answer, last, passes = ENDS[how]
    nothing = Nothing(met.peer, side, answer(met), last)
    monkeypatch.setattr(met, "testee", nothing)
    wrong = set()
    for check in checks_of(side):
        if check.name in SEEN_FROM_AFAR or check.lacks(met.facts):
            continue
        nothing.ensure_running()  # only the check is to meet it
        trial = met.trial(requirements("1.1")[check.requirement])
        trial.patience = SHORT_SECONDS
        if (said := outcome(check.play, trial)) != "says so" and not trial.losses:
            wrong.add(said)
        nothing.stop()
    assert wrong <= {f"{name} passes" for name in passes}


def outcome(function: Callable[[Trial], None], trial: Trial) -> str:
    """`passes`, `says so`, or how the harness failed."""
    try:
        function(trial)
    except (Violation, NotObservable, AdapterBroken):
        return "says so"
    except Exception as error:
        return f"{function.__name__} fails: {error!r}"
    return f"{function.__name__} passes" if trial.delivered else "says so"
