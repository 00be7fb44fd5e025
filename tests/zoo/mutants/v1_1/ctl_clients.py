"""Mutants that forget with a connection what they want to be in force (CTL-6)."""

from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.steering import Steering
from splatbus_wire.messages import CameraPose, Subscribe, SubscribeTelemetry, encode

from tests.zoo.faults.seams import client
from tests.zoo.mutant import mutant

AGAIN = "check_says_again_what_it_wants"


@mutant(
    "CTL-6",
    check="check_says_its_poses_again",
    code="not-said-again",
    axes="unity",
    at=client.BEGINS_TO_STEER,
)
def forgets_its_camera_with_the_connection(original, self):
    """Does not say its camera again when it has come back."""
    for key, message in list(self.newest.items()):
        if isinstance(message, CameraPose):
            del self.newest[key]
    return original(self)


@mutant("CTL-6", check=AGAIN, code="not-said-again")
def subscribes_on_its_first_connection_alone(patch):
    """Subscribes to colour on its first connection, and on no other."""
    first: list[IpcProtocol] = []

    def on_welcome(original, self, welcome):
        yield from original(self, welcome)
        if not first and "subscribe" in self.capabilities:
            first.append(self)
            self.unsent += encode(Subscribe(frozenset({"color"})))

    client.TAKES_WELCOME_ON_IPC.wrap(patch, on_welcome)


@mutant("CTL-6", check=AGAIN, code="not-said-again")
def wants_telemetry_on_its_first_connection_alone(patch):
    """Subscribes to telemetry on its first connection, and on no other."""
    first: list[Steering] = []

    def begin(original, self):
        machine = original(self)
        if not first:
            first.append(self)
            machine.tell(SubscribeTelemetry(None))
        return machine

    client.BEGINS_TO_STEER.wrap(patch, begin)
