"""Make of the reference server one that announces CUDA memory, as deployed renderers do.

There is no such memory: the handles are of nobody, and clients of 1.0 are sent them at once.
"""

from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet

from tests.zoo.faults.seams import server


def announces_at_once(patch, *messages, channel="ipc", most=None):
    """Send these messages to every client of a channel as soon as it comes; to so many at most."""
    greeted = 0

    def init(original, self, *arguments):
        nonlocal greeted
        original(self, *arguments)
        if self.channel == channel and (most is None or greeted < most):
            greeted += 1
            self.unsent += b"".join(packet(encode(message)) for message in messages)

    server.BEGINS_CONNECTION.wrap(patch, init)
