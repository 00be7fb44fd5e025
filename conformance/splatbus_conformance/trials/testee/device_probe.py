"""Which device the harness has; the first meeting over the stand-in: does the testee load it?"""

from splatbus_conformance.images.memory.cuda_stand_in.building import NotAvailable
from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage
from splatbus_conformance.images.memory.cuda_stand_in.session import StandIn
from splatbus_conformance.images.memory.device import Device
from splatbus_conformance.images.memory.gpu.device import find
from splatbus_conformance.plan import Plan, Usage
from splatbus_conformance.trials.memory_pace import of_the_device
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.trials.testee.client_probe import ClientFacts
from splatbus_conformance.trials.testee.process import Testee
from splatbus_conformance.trials.trial import EFFECT_SECONDS, SETTLE_SECONDS
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Peer

NOT_LOADED = (
    "the testee loaded neither the stand-in CUDA runtime nor its driver: it was started without "
    "the harness, or is linked with a runtime of its own (conformance/STAND_IN_CUDA.md)"
)


def stand_in_for(plan: Plan) -> StandIn | None:
    """The stand-in, if it is asked for. Raises Usage where it cannot be had."""
    try:
        return StandIn() if plan.stand_in_cuda else None
    except NotAvailable as error:
        raise Usage(str(error)) from None


def device_for(plan: Plan, stand_in: StandIn | None) -> Device | None:
    """The stand-in's device if that was asked for, else a GPU, if there is one that can be used."""
    return stand_in.device if stand_in else find()


def why_server_unseen(announced: Json | None, stand_in: StandIn) -> str | None:
    """Why nothing can be seen of what a server does with device memory, after it was met."""
    if not stand_in.calls():
        return NOT_LOADED
    if announced is None or "mem_color" not in announced:
        return "the testee loads the stand-in CUDA runtime, but announced no CUDA memory"
    return None


def why_unseen(
    peer: Peer,
    role: ScriptedServer,
    testee: Testee,
    stand_in: StandIn,
    patience: float,
    facts: ClientFacts,
) -> str | None:
    """Show the client good device memory: None if it opens it, else why nothing can be seen. How
    long it took joins what is known of its pace.

    One that loads CUDA late is given as long as it may take to connect.
    """
    image = DeviceImage(stand_in.device, role.width, role.height)
    image.draw(0)
    role.speaks, role.device_packet = "1.0", image.init_packet()
    peer.clear()
    peer.on_open, peer.on_message = role.on_open, role.on_message
    testee.ensure_running()
    pace = of_the_device(peer, testee, stand_in, image, patience + EFFECT_SECONDS)
    peer.close_all()
    peer.pump(SETTLE_SECONDS)
    image.free()
    if pace is not None:
        facts.memory_seconds = max(facts.memory_seconds, pace)
        return None
    if stand_in.calls():
        return "the testee loads the stand-in CUDA runtime, but did not open good device memory"
    return NOT_LOADED
