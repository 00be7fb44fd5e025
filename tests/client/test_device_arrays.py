"""Arrays of a frame as other libraries take them: DLPack is the same for memory of the host."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from splatbus_client import connect, cuda
from splatbus_client.cuda import arrays
from splatbus_client.cuda.arrays import DeviceArray

from tests.peers.fake_server import frame

HOST, CUDA = (1, 0), (2, 3)
IMAGE = np.arange(24, dtype=np.float32).reshape(2, 3, 4)


def lent(where, waited=None):
    read_on = (waited if waited is not None else []).append
    return DeviceArray(IMAGE.ctypes.data, IMAGE.shape, where, lambda s: read_on(s) or 7)


def test_an_array_is_taken_without_a_copy_and_given_back():
    array = np.from_dlpack(lent(HOST))
    np.testing.assert_array_equal(array, IMAGE)
    assert array.ctypes.data == IMAGE.ctypes.data
    assert len(arrays._lent) == 1
    del array
    gc.collect()
    assert not arrays._lent


def test_a_capsule_that_nobody_takes_is_given_back():
    capsule = lent(HOST).__dlpack__()
    assert arrays._lent
    del capsule
    assert not arrays._lent


@pytest.mark.parametrize(("stream", "waits"), [(None, 1), (1, 1), (2, 2), (99, 99), (-1, None)])
def test_the_stream_that_is_going_to_read_is_made_to_wait(stream, waits):
    waited = []
    lent(CUDA, waited).__dlpack__(stream=stream)
    assert waited == [waits]
    assert lent(CUDA).__dlpack_device__() == CUDA


def test_other_readers_get_the_pointer_and_a_stream_to_wait_for():
    waited = []
    interface = lent(CUDA, waited).__cuda_array_interface__
    assert interface["data"] == (IMAGE.ctypes.data, True)
    assert (interface["shape"], interface["typestr"]) == ((2, 3, 4), "<f4")
    assert interface["stream"] == 7
    assert lent(CUDA, waited).ready_on(5) == IMAGE.ctypes.data
    assert waited == [None, 5]


def test_images_on_the_host_are_on_no_device(server, session, memory):
    server.ipc_opened(memory).send(frame(7))
    with session.next_frame(5) as lease, pytest.raises(RuntimeError, match="memory of the host"):
        _ = lease.color_on_device


@pytest.mark.parametrize("here", [False, True])
def test_memory_on_a_gpu_is_asked_for_where_there_is_one(server, monkeypatch, here):
    monkeypatch.setattr(cuda, "usable", lambda: here)
    with connect("127.0.0.1", server.ipc_port, server.message_port):
        hello = server.ipc().receive()
    assert ("cuda_ipc" in hello["capabilities"]) is here
