"""How long a client takes to open memory that it is offered, and to read it: its pace, which is
measured when it is first met.

Some load CUDA, or build what they draw with, only then; no sentence limits that.
"""

from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage
from splatbus_conformance.images.memory.cuda_stand_in.session import StandIn
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.trials.testee.process import Testee
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.sockets import Connection, Peer

ROOM = 2.0
"""How many times as long as once a client may take, on a machine that is busy."""


def patience(pace: float, usual: float = EFFECT_SECONDS) -> float:
    """For how many seconds to wait until memory is opened, or read."""
    return usual + ROOM * pace


def of_the_host(peer: Peer, role: ScriptedServer, testee: Testee, seconds: float) -> float:
    """Wait until what was offered has been answered, and the first frame of it been given back.

    Returns how many seconds that took, 0 where nothing was offered or nothing came.
    """

    def uses_it() -> bool:
        dealt = [role.with_(it) for it in peer.connections if not it.ended]
        return not any(it.is_unanswered or it.lends for it in dealt)

    peer.until(lambda: uses_it() or testee.ended(), seconds)
    return max((_seconds_on(connection) for connection in peer.connections), default=0.0)


def _seconds_on(connection: Connection) -> float:
    """From the first packet, which memory is the answer to, to the first use of that."""
    first: dict[str | None, float] = {}
    for it in connection.messages:
        first.setdefault(it.type, it.packet.ended)
    used = [first[kind] for kind in ("opened", "release") if kind in first]
    return max(used) - min(first.values()) if used else 0.0


def of_the_device(
    peer: Peer, testee: Testee, stand_in: StandIn, image: DeviceImage, seconds: float
) -> float | None:
    """Wait until an image in device memory has been opened and read; how many seconds that took
    from the connection on, or None if it was not opened.
    """

    def waited(done: object) -> bool:
        return bool(done or testee.ended())

    peer.until(lambda: waited(image.opened(stand_in.calls())), seconds)
    calls = [it for it in stand_in.calls() if it.memory in image.names]
    if not image.opened(calls):
        return None
    peer.until(lambda: waited(image.copies(stand_in.calls())), EFFECT_SECONDS)
    first = (image.copies(stand_in.calls()) or calls)[0].time
    began = [it.opened for it in peer.connections if it.channel == "ipc" and it.opened < first]
    return first - max(began, default=first)
