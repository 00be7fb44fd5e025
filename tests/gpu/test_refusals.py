"""What cannot be opened or served says why, in words that help."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import splatbus_client
import splatbus_server
from splatbus_client.host_memory import CannotOpenError
from splatbus_wire.init_packet import init_packet_object, parse_init_packet
from splatbus_wire.semantics import Semantics

from tests.gpu import require_gpu

require_gpu()

from splatbus_client.cuda.driver import CudaError  # noqa: E402, F401
from splatbus_client.cuda.images import CudaImages  # noqa: E402
from splatbus_client.cuda.opened import _opened  # noqa: E402

from tests.gpu.images import memory  # noqa: E402

ROOT = Path(__file__).parents[2]


def exported(*, ends: bool):
    """An init packet of another process, and the process, dead or alive."""
    command = [sys.executable, "-m", "tests.gpu.exporter"]
    process = subprocess.Popen(
        command, cwd=ROOT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    packet = parse_init_packet(json.loads(process.stdout.readline()))
    if ends:
        process.kill()
        process.wait()
        process.stdin.close()
        process.stdout.close()
    return packet, process


def test_memory_of_the_same_process_is_refused():
    options = {"memory": "cuda_ipc", "ipc_port": 0, "message_port": 0}
    with (
        splatbus_server.serve(16, 8, **options) as bus,
        splatbus_client.connect(*bus.address) as session,
    ):
        deadline = time.monotonic() + 20
        while not session.status.no_images and time.monotonic() < deadline:
            time.sleep(0.05)
        with pytest.raises(TimeoutError, match="cannot open its own memory"):
            session.next_frame(0)


def test_memory_of_a_server_that_has_ended_is_refused():
    packet, _ = exported(ends=True)
    with pytest.raises(CannotOpenError, match="has ended"):
        CudaImages(packet)


def test_memory_of_a_device_that_is_not_seen_is_refused():
    packet, process = exported(ends=False)
    with process:
        elsewhere = packet.memory._replace(
            device_uuid="GPU-" + "0" * 8 + "-0000" * 3 + "-" + "0" * 12
        )
        with pytest.raises(CannotOpenError, match="CUDA_VISIBLE_DEVICES"):
            CudaImages(packet._replace(memory=elsewhere))
        process.kill()


def test_memory_that_is_too_small_is_refused_and_closed():
    packet, process = exported(ends=False)
    with process:
        larger = packet.memory._replace(bytes=1 << 40)
        with pytest.raises(CannotOpenError, match="MEM-6"):
            CudaImages(packet._replace(memory=larger))
        assert not _opened
        process.kill()


def test_memory_is_opened_once_however_many_read_it():
    packet, process = exported(ends=False)
    with process:
        one, other = CudaImages(packet), CudaImages(packet)
        assert len(_opened) == 1
        assert one.color(0).pointer == other.color(0).pointer
        assert one.close()
        assert (other.on_host("color", 0, other.color(0)) == 0).all()
        array = other.depth(0)
        assert not other.close()
        del array
        assert other.close()
        assert not _opened
        process.kill()


def test_a_client_that_sees_no_device_says_so():
    packet, process = exported(ends=False)
    program = f"""if True:
        from splatbus_client.cuda.images import CudaImages
        from splatbus_wire.init_packet import parse_init_packet
        try:
            CudaImages(parse_init_packet({init_packet_object(packet)!r}))
        except Exception as problem:
            print(problem)
    """
    with process:
        environment = os.environ | {"CUDA_VISIBLE_DEVICES": ""}
        said = subprocess.check_output([sys.executable, "-c", program], env=environment, text=True)
        process.kill()
    assert "look at CUDA_VISIBLE_DEVICES" in said


def test_a_server_that_dies_leaves_its_reader_alive():
    """What the reader then reads is no matter: its connection has ended too [CHN-18]."""
    program = """if True:
        from tests.gpu.test_refusals import *
        packet, process = exported(ends=False)
        images = CudaImages(packet)
        color = images.color(0)
        process.kill()
        process.wait()
        try:
            images.on_host("color", 0, color)
        except CudaError as problem:
            print(problem)
        del color
        print(images.close())
    """
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, text=True, capture_output=True, timeout=60
    )
    assert done.stdout.endswith("True\n"), done


def test_a_device_that_is_not_there_is_refused():
    with pytest.raises(OSError, match="CUDA_VISIBLE_DEVICES"):
        splatbus_server.serve(16, 8, memory="cuda_ipc", device=99, ipc_port=0, message_port=0)


def test_more_memory_than_there_is_is_refused(device, compiler):
    with pytest.raises(OSError, match="20 bytes a pixel"):
        memory((32768, 32768), device, compiler, Semantics()).successor(32768, 32768)
