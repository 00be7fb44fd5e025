"""Rules on the init packet's members of 1.0 (spec 1.0 chapter 4)."""

from collections.abc import Iterator
from typing import Any

from splatbus_schemas import LIMITS

from splatbus_conformance.rules import Breach, Judgement, Rule, Sighting, judged, rule
from splatbus_conformance.wire.conversation import Conversation
from splatbus_conformance.wire.json_values import (
    SAFE,
    integer_in,
    is_handle,
    show,
    unspeakable,
    whole,
)

Json = dict[str, Any]
MAX_SIZE: int = LIMITS["max_image_size"]
META = ("w", "h", "fmtColor", "pitchColor", "fmtDepth", "pitchDepth")
HANDLES = ("mem_color", "mem_depth", "evt_done")
FORMATS = {"fmtColor": "RGBA32F", "fmtDepth": "R32F"}
PIXEL_BYTES = {"Color": 16, "Depth": 4}


@rule("INI-1", "INI-2", "INI-3", "INI-4", "INI-5", "INI-6", "INI-7")
def members_of_1_0(conversation: Conversation) -> Iterator[Sighting]:
    """INI-1 to INI-7: members, sizes, formats, pitches, offsets, device and handles."""
    for message in conversation.of("init_packet"):
        yield from judged(conversation, message, layout(message.value or {}))


def layout(value: Json) -> Iterator[Judgement]:
    """What an init packet shows of INI-1 to INI-7."""
    yield Judgement("INI-1")
    meta = value.get("meta")
    if isinstance(meta, dict):
        for name in META:
            if name not in meta:
                text = f"meta has no member {name}"
                yield Judgement("INI-1", Breach("missing-member", text), f"/meta/{name}")
        yield from _meta(meta)
    elif "meta" in value:
        wrong = Breach("not-an-object", f"meta is {show(meta)}, no object")
        yield Judgement("INI-1", wrong, "/meta")
    else:
        yield Judgement("INI-1", Breach("missing-member", "meta is missing"), "/meta")
    for name in HANDLES if _in_cuda_memory(value) else ():
        if name not in value:
            yield Judgement("INI-1", Breach("missing-member", f"{name} is missing"), f"/{name}")
        else:
            yield handle(value[name], f"/{name}")


def handle(value: object, pointer: str) -> Judgement:
    """INI-7, of one handle."""
    text = f"{show(value)} is no base64 of {LIMITS['handle_bytes']} bytes"
    return Judgement("INI-7", None if is_handle(value) else Breach("not-a-handle", text), pointer)


def size(meta: object) -> tuple[int, int] | None:
    """Width and height that `meta` announces, where INI-2 holds."""
    if not isinstance(meta, dict):
        return None
    width, height = (whole(meta.get(name), 1, MAX_SIZE) for name in "wh")
    return None if width is None or height is None else (width, height)


def _in_cuda_memory(value: Json) -> bool:
    """INI-1 asks for handles, but not with `host_shm` (MEM-3); with a kind unknown, nobody can."""
    if "memory" not in value:
        return "version" not in value
    return isinstance(value["memory"], dict) and value["memory"].get("kind") == "cuda_ipc"


def _meta(meta: Json) -> Iterator[Judgement]:
    for name in "wh":
        if name in meta:
            text = f"{name} is {show(meta[name])}, no integer from 1 to {MAX_SIZE:,}"
            fits = integer_in(meta[name], 1, MAX_SIZE)
            wrong = None if fits else Breach("out-of-range", text)
            yield Judgement("INI-2", wrong, f"/meta/{name}")
    for name, expected in FORMATS.items():
        if name in meta:
            text = f'{name} is {show(meta[name])}, not "{expected}"'
            wrong = None if meta[name] == expected else Breach("wrong-format", text)
            yield Judgement("INI-3", wrong, f"/meta/{name}")
    for plane, pixel in PIXEL_BYTES.items():
        yield from _pitch(meta, f"pitch{plane}", pixel)
        yield from _offset(meta, f"offset{plane}", pixel)
    if "device" in meta:
        text = f"device is {show(meta['device'])}, no integer from 0 to {SAFE}"
        wrong = None if integer_in(meta["device"], 0) else Breach("out-of-range", text)
        yield Judgement("INI-6", wrong, "/meta/device")


def _pitch(meta: Json, name: str, pixel: int) -> Iterator[Judgement]:
    width = whole(meta.get("w"), 1, MAX_SIZE)
    if name in meta and not unspeakable(meta[name]):
        pitch = whole(meta[name], 1)
        wrong = Breach("wrong-pitch", f"{name} is {show(meta[name])}, not {pixel}·w")
        if pitch is None:
            yield Judgement("INI-4", wrong, f"/meta/{name}")
        elif width is not None:
            yield Judgement("INI-4", None if pitch == pixel * width else wrong, f"/meta/{name}")


def _offset(meta: Json, name: str, pixel: int) -> Iterator[Judgement]:
    if name in meta and not unspeakable(meta[name]):
        offset = whole(meta[name], 0)
        text = f"{name} is {show(meta[name])}, no multiple of {pixel} from 0 to {SAFE}"
        fits = offset is not None and offset % pixel == 0
        wrong = None if fits else Breach("wrong-offset", text)
        yield Judgement("INI-5", wrong, f"/meta/{name}")


RULES: tuple[Rule, ...] = (members_of_1_0,)
