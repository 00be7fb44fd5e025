"""The init packet: where the images are (1.0 chapter 4; 1.1 chapter 3)."""

from __future__ import annotations

import re
from base64 import b64decode, b64encode
from collections.abc import Mapping
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_wire.errors import ProtocolError
from splatbus_wire.fields import MAX_SAFE_INTEGER, Field
from splatbus_wire.semantics import Semantics, parse_semantics, semantics_object

COLOR_PIXEL_BYTES = 16
DEPTH_PIXEL_BYTES = 4
COLOR_FORMAT = "RGBA32F"
DEPTH_FORMAT = "R32F"
VERSION = "1.1"

MAX_IMAGE_SIZE: int = LIMITS["max_image_size"]
_MAX_SLOTS: int = LIMITS["max_slots"]
_HANDLE_BYTES: int = LIMITS["handle_bytes"]
ALIGNMENT = 16
_HANDLES = ("mem_color", "mem_depth", "evt_done")
SHM_NAME = re.compile(rf"(?!\.)[A-Za-z0-9._-]{{1,{LIMITS['max_shm_name_chars']}}}")
VERSIONS = re.compile(r"1\.[1-9][0-9]*")
_DEVICE_UUID = re.compile(r"GPU-[0-9a-f]{8}-(?:[0-9a-f]{4}-){3}[0-9a-f]{12}")


class LegacyBuffers(NamedTuple):
    """The buffers of 1.0: CUDA IPC handles of 64 bytes, and offsets in bytes [INI-1, INI-5 to 7].

    `device` is the server's CUDA ordinal, None where the packet does not say.
    """

    mem_color: bytes
    mem_depth: bytes
    evt_done: bytes
    offset_color: int = 0
    offset_depth: int = 0
    device: int | None = None


class HostMemory(NamedTuple):
    """Shared memory of the host by its name, `bytes` long [MEM-2]."""

    name: str
    bytes: int


class CudaMemory(NamedTuple):
    """Memory on a device, `bytes` long [MEM-2].

    `device_uuid` is `GPU-` and a UUID; the CUDA IPC handle of 64 bytes opens the allocation that
    holds the ring.
    """

    device_uuid: str
    handle: bytes
    bytes: int


class Slots(NamedTuple):
    """Slots for whole images; offsets and strides in bytes, CUDA event handles by slot [MEM-8].

    The offsets are from the start of the memory; those of `LegacyBuffers` mean nothing here.
    """

    slots: int
    color_offset: int
    color_stride: int
    depth_offset: int
    depth_stride: int
    events: tuple[bytes, ...] = ()


class InitPacket(NamedTuple):
    """Size of the images in pixels, and the memory that holds them.

    `legacy` is None with memory of the host; what follows it is None where the server speaks 1.0,
    but `ring` may be None with CUDA memory too, from a server without `frames` [MEM-8].
    """

    width: int
    height: int
    legacy: LegacyBuffers | None
    version: str | None = None
    generation: int | None = None
    memory: HostMemory | CudaMemory | None = None
    ring: Slots | None = None
    semantics: Semantics | None = None


def host_ring(width: int, height: int, slots: int) -> tuple[Slots, int]:
    """The closest packing of `slots` images, colour before depth, and its size in bytes.

    Args:
        width: in pixels.
        height: in pixels.
        slots: number of images.
    """
    color_stride = COLOR_PIXEL_BYTES * width * height
    depth_stride = -(-DEPTH_PIXEL_BYTES * width * height // ALIGNMENT) * ALIGNMENT
    depth_offset = slots * color_stride
    ring = Slots(slots, 0, color_stride, depth_offset, depth_stride)
    return ring, depth_offset + slots * depth_stride


def is_init_packet(message: Mapping[str, Any]) -> bool:
    """Whether a parsed payload is meant as one: it has `meta`, and no `type` [INI-11]."""
    return "meta" in message and "type" not in message


def parse_init_packet(message: Mapping[str, Any]) -> InitPacket:
    """Take an init packet out of a parsed payload.

    Args:
        message: as `parse_object` returns it; members that are not known are ignored [JSN-7], and
            a later 1.x is taken for 1.1 [MEM-18].

    Raises:
        ProtocolError: `invalid_message`, with the pointer and the one of INI-1 to INI-7, MEM-1 to
            MEM-3, MEM-7, MEM-8 and MEM-12 that is broken. Whether the memory that it announces is
            there and fits is for `check_fits`.
    """
    root = Field(message, "", "INI-1")
    width, height = _parse_size(root.member("meta"))
    if root.optional("version") is None:
        return InitPacket(width, height, _parse_legacy(root))
    root.under("MEM-1").member("version").matching(VERSIONS, f'"{VERSION}" or a later 1.x')
    generation = root.under("MEM-1").member("generation").integer(1, MAX_SAFE_INTEGER)
    memory = _parse_memory(root.under("MEM-2").member("memory"))
    if isinstance(memory, HostMemory):
        _parse_offsets(root.member("meta"))
        for name in _HANDLES:
            if (handle := root.under("MEM-3").optional(name)) is not None:
                raise handle.refused("must not be there with memory of the host")
    legacy = None if isinstance(memory, HostMemory) else _parse_legacy(root)
    described = root.under("MEM-8").optional("ring")
    if described is None and isinstance(memory, HostMemory):
        described = root.under("MEM-8").member("ring")
    ring = None if described is None else _parse_ring(described, width, height, memory)
    semantics = parse_semantics(root.under("MEM-12").member("semantics"))
    return InitPacket(width, height, legacy, VERSION, generation, memory, ring, semantics)


def readable_generation(message: dict[str, Any]) -> int | None:
    """The generation that an `open_failed` has to name although the packet is refused [OPN-1].

    None if the message is no init packet [INI-11], or has no valid `generation`.
    """
    try:
        generation = Field(message, "", "MEM-1").member("generation").integer(1, MAX_SAFE_INTEGER)
    except ProtocolError:
        return None
    return generation if is_init_packet(message) else None


def check_fits(packet: InitPacket, actual_bytes: int) -> None:
    """Check, before anything is read, that the memory is there and that every slot lies in it.

    Args:
        packet: of 1.1; there is nothing to check in one of 1.0.
        actual_bytes: size of the memory as the system reports it.

    Raises:
        ProtocolError: `invalid_message`: the memory is shorter than announced [MEM-6], a slot goes
            beyond it [MEM-10], or two of them overlap [MEM-9].
    """
    memory, ring = packet.memory, packet.ring
    if memory is None:
        return
    if actual_bytes < memory.bytes:
        raise ProtocolError(
            "invalid_message",
            f"memory is {actual_bytes} bytes long, {memory.bytes} were announced",
            requirement="MEM-6",
            pointer="/memory/bytes",
        )
    if ring is not None:
        check_slots(ring, packet.width * packet.height, memory.bytes)


def init_packet_object(packet: InitPacket) -> dict[str, Any]:
    """The init packet as the object that is sent [INI-1, MEM-1, MEM-2, MEM-3, MEM-8, MEM-12]."""
    meta: dict[str, Any] = {
        "w": packet.width,
        "h": packet.height,
        "fmtColor": COLOR_FORMAT,
        "pitchColor": COLOR_PIXEL_BYTES * packet.width,
        "fmtDepth": DEPTH_FORMAT,
        "pitchDepth": DEPTH_PIXEL_BYTES * packet.width,
    }
    message: dict[str, Any] = {}
    if packet.version is not None:
        message |= {"version": packet.version, "generation": packet.generation}
    message["meta"] = meta
    if (legacy := packet.legacy) is not None:
        meta |= {"offsetColor": legacy.offset_color, "offsetDepth": legacy.offset_depth}
        if legacy.device is not None:
            meta["device"] = legacy.device
        message |= {name: _base64(getattr(legacy, name)) for name in _HANDLES}
    if packet.memory is not None:
        message["memory"] = _memory_object(packet.memory)
    if packet.ring is not None:
        message["ring"] = _ring_object(packet.ring)
    if packet.semantics is not None:
        message["semantics"] = semantics_object(packet.semantics)
    return message


def _parse_size(meta: Field) -> tuple[int, int]:
    width, height = (
        meta.member(name).under("INI-2").integer(1, MAX_IMAGE_SIZE) for name in ("w", "h")
    )
    meta.member("fmtColor").under("INI-3").one_of([COLOR_FORMAT])
    meta.member("fmtDepth").under("INI-3").one_of([DEPTH_FORMAT])
    for name, pixel_bytes in ("pitchColor", COLOR_PIXEL_BYTES), ("pitchDepth", DEPTH_PIXEL_BYTES):
        pitch = meta.member(name).under("INI-4")
        if pitch.integer(1, MAX_SAFE_INTEGER) != pixel_bytes * width:
            raise pitch.refused(f"is not {pixel_bytes}·w, {pixel_bytes * width}")
    return width, height


def _parse_offsets(meta: Field) -> tuple[int, int, int | None]:
    offset_color = _parse_multiple(meta.under("INI-5").optional("offsetColor"), COLOR_PIXEL_BYTES)
    offset_depth = _parse_multiple(meta.under("INI-5").optional("offsetDepth"), DEPTH_PIXEL_BYTES)
    device = meta.under("INI-6").optional("device")
    ordinal = None if device is None else device.integer(0, MAX_SAFE_INTEGER)
    return offset_color, offset_depth, ordinal


def _parse_legacy(root: Field) -> LegacyBuffers:
    offset_color, offset_depth, device = _parse_offsets(root.member("meta"))
    color, depth, event = (_parse_handle(root.member(name).under("INI-7")) for name in _HANDLES)
    return LegacyBuffers(color, depth, event, offset_color, offset_depth, device)


def _parse_multiple(number: Field | None, unit: int, least: int = 0) -> int:
    if number is None:
        return 0
    value = number.integer(least, MAX_SAFE_INTEGER)
    if value % unit:
        raise number.refused(f"is {value}, not a multiple of {unit}")
    return value


def _parse_handle(handle: Field) -> bytes:
    text = handle.string(0, MAX_SAFE_INTEGER)
    try:
        decoded = b64decode(text)
    except ValueError:
        decoded = b""
    # Encoded again, because decoding skips what is not of the alphabet and ignores stray bits.
    if len(decoded) != _HANDLE_BYTES or _base64(decoded) != text:
        raise handle.refused(f"is not {_HANDLE_BYTES} bytes in base64, standard alphabet, padded")
    return decoded


def _parse_memory(memory: Field) -> HostMemory | CudaMemory:
    kind = memory.member("kind").one_of(["host_shm", "cuda_ipc"])
    size = memory.member("bytes").integer(1, MAX_SAFE_INTEGER)
    if kind == "cuda_ipc":
        uuid = memory.member("deviceUuid").matching(_DEVICE_UUID, "GPU- and a UUID in lower case")
        return CudaMemory(uuid, _parse_handle(memory.member("handle")), size)
    name = memory.member("name").under("MEM-7")
    return HostMemory(name.matching(SHM_NAME, "a name of 1 to 30 of A-Z a-z 0-9 . _ -"), size)


def _parse_ring(ring: Field, width: int, height: int, memory: HostMemory | CudaMemory) -> Slots:
    slots = ring.member("slots").integer(1, _MAX_SLOTS)
    color_bytes = COLOR_PIXEL_BYTES * width * height
    depth_bytes = DEPTH_PIXEL_BYTES * width * height
    events: tuple[bytes, ...] = ()
    if isinstance(memory, CudaMemory):
        handles = ring.member("events").items(slots, slots)
        events = tuple(_parse_handle(handle.under("INI-7")) for handle in handles)
    return Slots(
        slots,
        _parse_multiple(ring.member("colorOffset"), ALIGNMENT),
        _parse_multiple(ring.member("colorStride"), ALIGNMENT, color_bytes),
        _parse_multiple(ring.member("depthOffset"), ALIGNMENT),
        _parse_multiple(ring.member("depthStride"), ALIGNMENT, depth_bytes),
        events,
    )


def check_slots(ring: Slots, pixels: int, memory_bytes: int) -> None:
    """Refuse slots that leave the memory [MEM-10], or overlap."""
    extents = [
        (start, start + pixel_bytes * pixels, name)
        for name, offset, stride, pixel_bytes in (
            ("color", ring.color_offset, ring.color_stride, COLOR_PIXEL_BYTES),
            ("depth", ring.depth_offset, ring.depth_stride, DEPTH_PIXEL_BYTES),
        )
        for start in range(offset, offset + ring.slots * stride, stride)
    ]
    for _, end, name in extents:
        if end > memory_bytes:
            raise ProtocolError(
                "invalid_message",
                f"the {name} of the last slot ends at byte {end} of {memory_bytes}",
                requirement="MEM-10",
                pointer=f"/ring/{name}Offset",
            )
    check_overlaps(sorted(extents))


def check_overlaps(placed: list[tuple[int, int, str]]) -> None:
    """Refuse slots, in the order of their places, of which one reaches into the next [MEM-9]."""
    for (_, end, name), (start, _, other) in zip(placed, placed[1:]):
        if end > start:
            raise ProtocolError(
                "invalid_message",
                f"a slot's {name} and a slot's {other} overlap at byte {start}",
                requirement="MEM-9",
                pointer="/ring",
            )


def _memory_object(memory: HostMemory | CudaMemory) -> dict[str, Any]:
    if isinstance(memory, HostMemory):
        return {"kind": "host_shm", "name": memory.name, "bytes": memory.bytes}
    return {
        "kind": "cuda_ipc",
        "deviceUuid": memory.device_uuid,
        "handle": _base64(memory.handle),
        "bytes": memory.bytes,
    }


def _ring_object(ring: Slots) -> dict[str, Any]:
    layout: dict[str, Any] = {
        "slots": ring.slots,
        "colorOffset": ring.color_offset,
        "colorStride": ring.color_stride,
        "depthOffset": ring.depth_offset,
        "depthStride": ring.depth_stride,
    }
    return layout | ({"events": [_base64(event) for event in ring.events]} if ring.events else {})


def _base64(data: bytes) -> str:
    return b64encode(data).decode("ascii")
