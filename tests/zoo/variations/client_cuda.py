"""Allowed variations: clients whose images are in memory of a GPU."""

from splatbus_client.events import Ignored

from tests.zoo.faults.seams import client
from tests.zoo.mutant import variation
from tests.zoo.variations.client import closes_on_what_is_broken


@variation(at=client.TAKES_INIT_PACKET_OF_1_0)
def opens_one_image_a_connection(original, self, packet):
    """Opens what the first init packet of a connection names, and looks at no other."""
    if self.version is None:
        yield from original(self, packet)
    else:
        yield Ignored("it has an image")


@variation()
def closes_on_what_is_broken_beside_a_device(patch):
    """Closes the connection on broken text and broken init packets, instead of ignoring them."""
    closes_on_what_is_broken(patch)
