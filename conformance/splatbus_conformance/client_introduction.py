"""The first meeting with a client: what it does when left alone.

Checks ask no more of it than it has shown here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from splatbus_conformance import meeting, processes
from splatbus_conformance.adapter import Greeting
from splatbus_conformance.device_memory import why_no_device
from splatbus_conformance.kinds import POSES, REQUESTS, REQUESTS_1_0
from splatbus_conformance.lenient_json import read
from splatbus_conformance.messages import Json
from splatbus_conformance.peer import CHANNELS, Connection, Peer
from splatbus_conformance.recording import Channel
from splatbus_conformance.role import Role
from splatbus_conformance.testee import Testee, not_met
from splatbus_conformance.trial import SETTLE_SECONDS as TRIAL_SETTLE_SECONDS

SETTLE_SECONDS = 1.0
PARTING_SECONDS = 0.5
RETURN_SECONDS = 5.0


@dataclass
class ClientFacts:
    """What the testee showed of itself when it was first met."""

    hello: dict[Channel, Json | None] = field(default_factory=lambda: {"ipc": None, "msg": None})
    connects: set[Channel] = field(default_factory=set)
    asks: set[str] = field(default_factory=set)
    """Types of the requests that it makes when it connects."""
    asks_again: bool = True
    """It asks on each connection, as far as is known; others ask once after they were started."""
    says: set[str] = field(default_factory=set)
    """Types of all that it sends when it connects."""
    poses: bool = False
    """It sends poses unasked."""
    opens: bool = False
    """It opened the memory that it was offered."""
    adapter: Greeting | None = None
    """What the adapter beside it says of itself, where there is one."""
    device_unseen: str | None = "only the stand-in CUDA runtime could show it: --stand-in-cuda"
    """Why nothing is seen of what it does with device memory; None if it is seen."""
    device: str = ""
    """Where device memory for it lies: a GPU, or the stand-in; nothing if there is none."""
    returns: set[Channel] = field(default_factory=set)
    """Channels that it connects to again after its connection was closed."""
    advice: list[str] = field(default_factory=list)
    """What the meeting suggests to its author."""

    def speaks_1_1(self, channel: Channel) -> bool:
        """It said `hello` on this channel."""
        return self.hello[channel] is not None

    def capabilities(self) -> list[str]:
        """What it declared on the IPC channel."""
        declared: Any = (self.hello["ipc"] or {}).get("capabilities", [])
        return declared if isinstance(declared, list) else []

    def version(self) -> str:
        """The newest version that it speaks: it is judged by that."""
        return "1.1" if any(self.hello.values()) else "1.0"

    def __str__(self) -> str:
        """What it did when it was left alone, for those who know what it should have done."""
        if not self.connects:
            return "it connects to neither channel"
        where = " and ".join(meeting.NAMES[it] for it in CHANNELS if it in self.connects)
        back = [meeting.NAMES[it] for it in CHANNELS if it in self.returns]
        parts = [
            f"it speaks {self.version()}",
            f"connects to {where}",
            f"sends {', '.join(sorted(self.says))}"
            if self.says
            else "sends nothing that can be read",
        ]
        if self.version() == "1.1":
            parts.append("opens the memory" if self.opens else "does not open the memory")
        parts.append(f"comes back to {' and '.join(back)}" if back else "does not come back")
        return ", ".join(parts)

    def lacks(self, need: str) -> str | None:
        """Why a check that needs this can show nothing, or None if it can."""
        kind, _, of = need.partition(":")
        if kind == "hello":
            if self.hello["ipc" if of == "ipc" else "msg"] is not None:
                return None
            return f"the testee says no hello on the {of} channel: 1.1 is not claimed"
        if kind == "stand-in":
            return self.device_unseen
        if kind == "device":
            return why_no_device(self.device, self.device_unseen)
        if kind == "returns":
            known, why = of in self.returns, f"does not connect to the {of} channel again"
        elif kind == "capability":
            known, why = of in self.capabilities(), f"does not declare the capability {of}"
        elif kind in CHANNELS:
            known, why = kind in self.connects, f"makes no connection on the {kind} channel"
        elif kind == "asks":
            known, why = bool(self.asks), "makes no request when it connects"
        elif kind == "says":
            known, why = of in self.says, f"sends no {of} when it connects"
        elif kind == "poses":
            known, why = self.poses, "sends no poses unasked"
        elif kind in ("adapter", "axes"):
            return self._adapter_lacks(kind, of)
        elif kind == "opens":
            known, why = self.opens, "did not open good memory when it was first met"
        else:
            raise ValueError(f"a check needs {need!r}, which nobody knows")
        return None if known else f"the testee {why}"

    def _adapter_lacks(self, kind: str, of: str) -> str | None:
        if self.adapter is None:
            return "only an adapter could show it: --adapter"
        if kind == "adapter":
            return None if of in self.adapter.can else f"the adapter has no command {of}"
        return (
            None if of == self.adapter.axes else f"its poses are in the axes of {self.adapter.axes}"
        )


def introduce(peer: Peer, role: Role, testee: Testee, patience: float) -> ClientFacts:
    """Meet the testee as a well-behaved server: what does it say, ask, send, and does it return?

    Raises NoVerdict if no connection comes within `patience` seconds.
    """
    peer.clear()
    peer.on_open, peer.on_packet = role.on_open, role.on_packet
    testee.ensure_running()
    peer.until(lambda: peer.connections or testee.ended(), patience)
    if not peer.connections:
        where = " and ".join(f"{name} {peer.host}:{peer.ports[name]}" for name in CHANNELS)
        raise not_met(testee, "client", where, peer.host, patience)
    peer.until(lambda: {c.channel for c in peer.connections} == set(CHANNELS), SETTLE_SECONDS)
    peer.until(lambda: _everything(_shown(peer, role)), SETTLE_SECONDS)
    facts = _shown(peer, role)
    met = list(peer.connections)
    seen = [_met(connection, role, testee) for connection in met]
    facts.advice = meeting.on_client(seen, peer.ports, testee.group)
    _take_leave(peer, met)
    peer.until(
        lambda: {c.channel for c in peer.connections if c not in met} == facts.connects,
        RETURN_SECONDS,
    )
    facts.returns = {c.channel for c in peer.connections if c not in met}
    peer.pump(TRIAL_SETTLE_SECONDS)
    return facts


def _take_leave(peer: Peer, met: Sequence[Connection]) -> None:
    """Close, and let the testee close first: what it sends to one that is closed resets it."""
    for connection in met:
        connection.end_stream()
    peer.until(lambda: all(connection.ended for connection in met), PARTING_SECONDS)
    for connection in met:
        connection.close()


def _shown(peer: Peer, role: Role) -> ClientFacts:
    facts = ClientFacts()
    for connection in peer.connections:
        dealings = role.with_(connection)
        facts.connects.add(connection.channel)
        facts.hello[connection.channel] = facts.hello[connection.channel] or dealings.hello
        kinds = {str(message.get("type")) for message in dealings.heard}
        facts.says |= kinds
        if connection.channel == "msg":
            facts.asks |= kinds & set(REQUESTS)
            facts.poses = facts.poses or bool(kinds & set(POSES))
        facts.opens = facts.opens or bool(dealings.opened)
    return facts


def _everything(facts: ClientFacts) -> bool:
    """There is nothing more to wait for."""
    shown = all(facts.hello.values()) and facts.asks >= set(REQUESTS_1_0) and facts.poses
    return shown and (facts.opens or "host_shm" not in facts.capabilities())


def _met(connection: Connection, role: Role, testee: Testee) -> meeting.Met:
    dealings = role.with_(connection)
    unread = (it.payload for it in connection.packets if read(it.payload).value is None)
    return meeting.Met(
        connection.channel,
        connection.port,
        dealings.heard,
        connection.no_packet,
        next(unread, b""),
        connection.ended is not None,
        _offered(role, connection),
        next((str(it.get("reason")) for it in dealings.heard if _declines(it)), ""),
        _process(connection, testee),
    )


def _offered(role: Role, connection: Connection) -> str:
    """What a client was told of images on a connection, if it was told any."""
    dealings = role.with_(connection)
    told = dealings.generation or dealings.count("get_viewport_size")
    return f"images of {role.width}x{role.height}" if told else ""


def _declines(message: Json) -> bool:
    return message.get("type") == "open_failed"


def _process(connection: Connection, testee: Testee) -> int | None:
    """The process at the other end; those that the harness started count as one."""
    process = processes.owner(connection.testee_port, connection.port)
    return testee.group if process and processes.group(process) == testee.group else process
