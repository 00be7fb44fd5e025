"""The first meeting with a client over device memory: does it come to the stand-in at all?"""

from splatbus_conformance.peer import Peer
from splatbus_conformance.role import Role
from splatbus_conformance.stand_in.image import DeviceImage
from splatbus_conformance.stand_in.session import StandIn
from splatbus_conformance.testee import Testee
from splatbus_conformance.trial import EFFECT_SECONDS, SETTLE_SECONDS


def why_unseen(peer: Peer, role: Role, testee: Testee, stand_in: StandIn) -> str | None:
    """Show the client good device memory: None if it opens it, else why nothing can be seen."""
    image = DeviceImage(stand_in.device, role.width, role.height)
    image.draw(0)
    role.speaks, role.device_packet = "1.0", image.init_packet()
    peer.clear()
    peer.on_open, peer.on_packet = role.on_open, role.on_packet
    testee.ensure_running()
    peer.until(lambda: image.opened(stand_in.calls()) or testee.ended(), EFFECT_SECONDS)
    opened = image.opened(stand_in.calls())
    peer.close_all()
    peer.pump(SETTLE_SECONDS)
    image.free()
    if opened:
        return None
    if stand_in.calls():
        return "the testee loads the stand-in CUDA runtime, but did not open good device memory"
    return (
        "the testee did not load the stand-in CUDA runtime: it was started without the harness, is "
        "linked with another one, or uses the driver (conformance/STAND_IN_CUDA.md)"
    )
