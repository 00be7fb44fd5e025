"""Rules on the init packet's members of 1.0 (spec 1.0 chapter 4)."""

from collections.abc import Iterator

from splatbus_schemas import LIMITS

from splatbus_conformance.rules import Breach, Json, Judgement, Sighting, judged, rule
from splatbus_conformance.rules.form import form
from splatbus_conformance.wire.conversation import Conversation
from splatbus_conformance.wire.json_values import is_handle, show, whole

MAX_SIZE: int = LIMITS["max_image_size"]
HANDLES = ("mem_color", "mem_depth", "evt_done")
OF_META = {
    "INI-2": ("w", "h"),
    "INI-3": ("fmtColor", "fmtDepth"),
    "INI-4": ("pitchColor", "pitchDepth"),
    "INI-5": ("offsetColor", "offsetDepth"),
    "INI-6": ("device",),
}
"""What is asked of which members of `meta`."""
PIXEL_BYTES = {"Color": 16, "Depth": 4}


@rule("INI-1", "INI-2", "INI-3", "INI-4", "INI-5", "INI-6", "INI-7")
def members_of_1_0(conversation: Conversation) -> Iterator[Sighting]:
    """INI-1 to INI-7: members, sizes, formats, pitches, offsets, device and handles."""
    for message in conversation.of("init_packet"):
        yield from judged(message, layout(message.members))


def layout(value: Json) -> Iterator[Judgement]:
    """What an init packet shows of INI-1 to INI-7."""
    meta = value.get("meta")
    told = meta if isinstance(meta, dict) else {}
    shows = [name for name, members in OF_META.items() if not told.keys().isdisjoint(members)]
    if in_cuda := _in_cuda_memory(value):
        shows += ["INI-7"] if not value.keys().isdisjoint(HANDLES) else []
    for judgement in form(value, "init_packet", "INI-1", *shows, version="1.0"):
        if in_cuda or judgement.pointer[1:] not in HANDLES:
            yield judgement
    width = whole(told.get("w"), 1, MAX_SIZE)
    for plane, pixel in PIXEL_BYTES.items():
        pitch = whole(told.get(f"pitch{plane}"), 1)
        if width and pitch and pitch != pixel * width:
            wrong = Breach("wrong-pitch", f"pitch{plane} is {pitch}, not {pixel}·w")
            yield Judgement("INI-4", wrong, f"/meta/pitch{plane}")


def handle(value: object, pointer: str) -> Judgement:
    """INI-7, of one handle."""
    text = f"{show(value)} is no base64 of {LIMITS['handle_bytes']} bytes"
    return Judgement("INI-7", None if is_handle(value) else Breach("bad-string", text), pointer)


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
