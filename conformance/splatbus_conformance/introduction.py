"""The first meeting with a testee: what it does when left alone.

Checks ask no more of it than it has shown here.
"""

from splatbus_conformance.peer import CHANNELS, Peer
from splatbus_conformance.role import Role
from splatbus_conformance.testee import Testee
from splatbus_conformance.trial import SETTLE_SECONDS as TRIAL_SETTLE_SECONDS
from splatbus_conformance.trial import Facts

SETTLE_SECONDS = 1.0
RETURN_SECONDS = 5.0
REQUESTS = 2
"""Kinds of request that there are."""


class NothingConnects(Exception):  # noqa: N818 - a finding, no error of ours
    """No connection came; the message says what to look at."""


def introduce(peer: Peer, role: Role, testee: Testee, patience: float) -> Facts:
    """Meet the testee as a well-behaved server: what does it say, ask, send, and does it return?

    Raises NothingConnects if no connection comes within `patience` seconds.
    """
    peer.clear()
    peer.on_open, peer.on_packet = role.on_open, role.on_packet
    testee.ensure_running()
    peer.until(lambda: peer.connections or testee.ended(), patience)
    if not peer.connections:
        raise NothingConnects(_why_nothing(peer, testee, patience))
    peer.until(lambda: {c.channel for c in peer.connections} == set(CHANNELS), SETTLE_SECONDS)
    peer.until(lambda: _everything(_shown(peer, role)), SETTLE_SECONDS)
    facts = _shown(peer, role)
    peer.close_all()
    met = list(peer.connections)
    peer.until(
        lambda: {c.channel for c in peer.connections if c not in met} == facts.connects,
        RETURN_SECONDS,
    )
    facts.returns = {c.channel for c in peer.connections if c not in met}
    peer.pump(TRIAL_SETTLE_SECONDS)
    return facts


def _shown(peer: Peer, role: Role) -> Facts:
    facts = Facts()
    for connection in peer.connections:
        dealings = role.with_(connection)
        facts.connects.add(connection.channel)
        facts.hello[connection.channel] = facts.hello[connection.channel] or dealings.hello
        for message in dealings.heard:
            kind = str(message.get("type"))
            if kind.startswith("get_"):
                facts.asks.add(kind)
            facts.poses = facts.poses or kind in ("camera_pose", "point_cloud_pose")
        facts.opens = facts.opens or bool(dealings.opened)
    return facts


def _everything(facts: Facts) -> bool:
    """There is nothing more to wait for."""
    shown = all(facts.hello.values()) and len(facts.asks) == REQUESTS and facts.poses
    return shown and (facts.opens or "host_shm" not in facts.capabilities())


def _why_nothing(peer: Peer, testee: Testee, patience: float) -> str:
    where = " and ".join(f"{name} {peer.host}:{peer.ports[name]}" for name in CHANNELS)
    text = f"nothing connected to {where} within {patience:g} s"
    if ended := testee.ended():
        text = f"nothing connected to {where}: the testee {ended}"
    if output := testee.output().strip():
        text += "; the last that it printed:\n" + output
    return text + (
        "\nThe testee finds these ports in SPLATBUS_HOST, SPLATBUS_IPC_PORT and SPLATBUS_MSG_PORT;"
        "\nif it knows only fixed ports, name them: --ports 6001,6000 (IPC, message)."
    )
