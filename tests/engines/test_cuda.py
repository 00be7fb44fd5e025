"""Images in memory of a GPU, here the stand-in's, where the harness does not look."""

from pathlib import Path

from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage, text_of
from splatbus_conformance.images.memory.cuda_stand_in.usage import held

from tests.conformance.images.cuda_stand_in.library import stand_in
from tests.engines.built import answers, built
from tests.wire.payloads import payload
from tests.wire.test_init_packet import CUDA, with_value

NOBODY = "01234567-89ab-cdef-0123-456789abcdef"


def test_what_cannot_be_opened_is_refused_and_why(tmp_path: Path) -> None:
    """[MEM-6, MEM-17, INI-13]"""
    with stand_in() as it:
        legacy = DeviceImage(it.device).init_packet()
        plane, event = it.device.allocate(2 * 20_480), it.device.event()
        ring = {
            "slots": 2,
            "colorOffset": 0,
            "colorStride": 16_384,
            "depthOffset": 32_768,
            "depthStride": 4_096,
            "events": 2 * [text_of(event.handle)],
        }
        memory = {"kind": "cuda_ipc", "deviceUuid": it.device.uuid, "bytes": 2 * 20_480}
        memory["handle"] = text_of(plane.handle)
        good = CUDA | legacy | {"memory": memory, "ring": ring}
        good["meta"] = legacy["meta"] | {"w": 32, "h": 32, "pitchColor": 512, "pitchDepth": 128}
        gone = it.device.allocate(20_480)
        gone.free()
        beyond = 16 * 64 * 48 + 4
        cases = {
            "open": [good, DeviceImage(it.device).init_packet()],
            "memory is 40960 bytes long, 40961 were announced [MEM-6]": [
                with_value(good, "/memory/bytes", 40_961)
            ],
            "an image ends beyond the memory of 61440 bytes": [
                with_value(legacy, "/meta/offsetDepth", beyond)
            ],
            "this process sees GPU-": [with_value(good, "/memory/deviceUuid", f"GPU-{NOBODY}")],
            "this process sees 2": [with_value(legacy, "/meta/device", 2)],
            "cuIpcOpenMemHandle: invalid argument (CUDA_ERROR_INVALID_VALUE); it was freed": [
                with_value(good, "/memory/handle", text_of(gone.handle)),
                with_value(legacy, "/mem_depth", text_of(gone.handle)),
            ],
            "cuIpcOpenEventHandle: mapping of buffer object failed": [
                with_value(good, "/ring/events/1", text_of(plane.handle)),
                with_value(legacy, "/evt_done", text_of(plane.handle)),
            ],
        }
        program = [*built("cpp", "Tests", tmp_path), "--open"]
        payloads = [payload(packet) for packets in cases.values() for packet in packets]
        told = answers(program, payloads, it.environment())
        opened = {call for call in it.calls() if call.function == "cudaIpcOpenMemHandle"}
        assert opened
        assert held(it.calls()) == set(), "what was opened before it failed is closed"
    wanted = [why for why, packets in cases.items() for _ in packets]
    assert [why in each for why, each in zip(wanted, told, strict=True)] == len(told) * [True], told
