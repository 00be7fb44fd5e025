"""The thread that waits, and those who wait for it."""

import math
import selectors
import socket
import time

from splatbus_client.loop import Loop

SECONDS = 0.02


class Flooded:
    """A channel on which there is always something to read, and on which reading takes its time."""

    def __init__(self):
        self.socket, self._server = socket.socketpair()
        self._server.send(b"x")
        self.rounds = 0

    def interest(self):
        return selectors.EVENT_READ

    def deadline(self):
        return math.inf

    def advance(self, now):
        pass

    def ready(self, mask, now):
        self.rounds += 1
        end = time.perf_counter() + SECONDS
        while time.perf_counter() < end:  # as a parser does, without a pause
            pass

    def flush(self, now):
        pass

    def close(self):
        self.socket.close()
        self._server.close()


def test_a_server_that_sends_without_end_lets_others_have_their_turn():
    channel = Flooded()
    begun = time.perf_counter()
    loop = Loop((channel,), lambda: None, lambda: None)
    while channel.rounds < 20:
        time.sleep(0.01)
    loop.close()
    read = channel.rounds * SECONDS
    assert read <= 0.6 * (time.perf_counter() - begun)
