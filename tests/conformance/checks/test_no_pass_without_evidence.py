"""No check passes a testee that does nothing: one that is deaf, one that is mute, one that dies.

Each check of the harness is run as if the testee had shown all that the reference shows, and each
wait is cut short: what does nothing does not do more of it in five seconds.
"""

import contextlib
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
from splatbus_conformance.wire.sockets import CHANNELS, Peer
from splatbus_schemas.requirements import requirements

REFERENCE: dict[Side, str] = {
    "client": f'"{sys.executable}" -m splatbus_viewer view',
    "server": f'"{sys.executable}" -m splatbus_renderer --quiet --size 64x48',
}
SHORT_SECONDS = 0.03
SEEN_FROM_AFAR = {"check_host_and_ports_can_be_set", "check_listens_on_loopback_alone"}
"""To connect, or to listen, where it was told to is all that these ask for."""


class Nothing:
    """A testee that only connects, or only accepts."""

    name, argv, group, started, expendable = "nothing", (), None, 0.0, True
    greeting = None

    def __init__(self, peer: Peer, side: Side, *, dies: bool) -> None:
        self.peer, self.side, self.dies = peer, side, dies
        self.open: list[socket.socket] = []
        self.listeners: list[socket.socket] = []
        self.dead = False

    def ensure_running(self) -> bool:
        if self.open or self.listeners:
            return False
        self.dead = self.dies
        if self.side == "client":
            with contextlib.suppress(OSError):
                for channel in CHANNELS:
                    address = self.peer.host, self.peer.ports[channel]
                    self.open.append(socket.create_connection(address, SHORT_SECONDS))
        else:
            for channel in CHANNELS:
                address = self.peer.host, self.peer.ports[channel]
                self.listeners.append(_listen(address))
                if not self.dies:
                    threading.Thread(target=_accept, args=(self, self.listeners[-1])).start()
        if self.dies:
            self.stop()
            self.dead = True
        return True

    def ended(self) -> Ended | None:
        return Ended(-11, crashed=True) if self.dead else None

    def stop(self) -> Ended | None:
        for listener in self.listeners:
            with contextlib.suppress(OSError):
                listener.shutdown(socket.SHUT_RDWR)
            listener.close()
        for each in self.open:
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


def _accept(nothing: Nothing, listener: socket.socket) -> None:
    """Accept, and leave what comes unread."""
    with contextlib.suppress(OSError):
        while True:
            nothing.open.append(listener.accept()[0])


@pytest.fixture(scope="module", params=["client", "server"])
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


@pytest.mark.filterwarnings("ignore")  # as where checks run
@pytest.mark.parametrize("dies", [False, True], ids=["deaf", "dies"])
def test_no_check_passes_a_testee_that_does_nothing(
    met: Testbed, dies: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    side: Side = "client" if "Client" in type(met).__name__ else "server"
    nothing = Nothing(met.peer, side, dies=dies)
    monkeypatch.setattr(met, "testee", nothing)
    wrong = []
    for check in checks_of(side):
        if check.name in SEEN_FROM_AFAR:
            continue
        if check.lacks(met.facts):
            continue
        trial = met.trial(requirements("1.1")[check.requirement])
        trial.patience = SHORT_SECONDS
        wrong.append(outcome(check.play, trial))
        nothing.stop()
    assert set(wrong) == {"says so"}


def outcome(function: Callable[[Trial], None], trial: Trial) -> str:
    """`passes`, `says so`, or how the harness failed."""
    try:
        function(trial)
    except (Violation, NotObservable, AdapterBroken):
        return "says so"
    except Exception as error:
        return f"{function.__name__} fails: {error!r}"
    return f"{function.__name__} passes" if trial.delivered else "says so"
