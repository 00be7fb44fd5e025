"""The harness leaves nothing behind in shared memory."""

import sys

import pytest
from splatbus_conformance.images.memory.host import LINUX_FOLDER, HostMemory

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Linux alone lists shared memory")


def test_memory_goes_when_it_is_closed() -> None:
    memory = HostMemory(4096)
    assert memory.exists()
    memory.close()
    assert not memory.exists()


def test_a_write_by_somebody_else_changes_the_digest() -> None:
    memory = HostMemory(4096)
    try:
        before = memory.digest()
        with (LINUX_FOLDER / memory.name).open("r+b") as file:
            file.write(b"x")
        assert memory.digest() != before
    finally:
        memory.close()
