"""A client of a server that a test plays."""

import pytest
import splatbus_client

from tests.peers.fake_server import FakeServer, Memory


@pytest.fixture
def server():
    server = FakeServer()
    yield server
    server.stop()


@pytest.fixture
def session(server):
    """A session with the fake server; the test accepts its connections."""
    with splatbus_client.connect("127.0.0.1", server.ipc_port, server.message_port) as session:
        yield session


@pytest.fixture
def memory():
    memory = Memory()
    yield memory
    memory.remove()
