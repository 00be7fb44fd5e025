"""Make the server close the oldest clients of a channel in favour of further ones."""

from tests.zoo.faults.seams import server


def keeps_the_newest(patch, count):
    """Keep so many clients on each channel."""

    def accept(original, self, channel, listener):
        served = [peer for peer in self.peers if peer.connection.channel == channel]
        for peer in served[: max(0, len(served) + 1 - count)]:
            self.drop(peer)
        original(self, channel, listener)

    server.ACCEPTS_CLIENT.wrap(patch, accept)
