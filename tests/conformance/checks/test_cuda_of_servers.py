"""The checks of device memory on servers: good miniatures pass, broken ones fail as they should."""

import shutil
from pathlib import Path

import pytest
from splatbus_conformance.checks.v1_0.buf import servers as images
from splatbus_conformance.checks.v1_0.cud import servers as device
from splatbus_conformance.checks.v1_1 import opn
from splatbus_conformance.checks.v1_1.img import servers as frames

from tests.conformance.images.cuda_stand_in.library import checks_in, in_device_memory, judged

pytestmark = pytest.mark.apart

MINIATURES = Path(__file__).parents[1] / "miniatures"
OF_IMAGES, OF_FRAMES = MINIATURES / "cuda_server.py", MINIATURES / "cuda_frames_server.py"
OF_A_RING = "check_records_the_event_before_the_frame", "check_keeps_memory_while_somebody_has_it"
OF_SCENES = {"BUF-1", "BUF-6"}
"""What takes a scene that is known: test_device_poses.py."""
STORED = {
    name: check
    for name, check in in_device_memory(images).items()
    if check.requirement not in OF_SCENES
}
CHECKS = {
    OF_IMAGES: checks_in(device) | STORED,
    OF_FRAMES: {name: check for name, check in checks_in(frames, opn).items() if name in OF_A_RING},
}
ALL_CHECKS = CHECKS[OF_IMAGES] | CHECKS[OF_FRAMES]


def test_the_good_miniature_of_images_passes_every_check() -> None:
    checks = CHECKS[OF_IMAGES]
    assert judged("server", OF_IMAGES, checks) == dict.fromkeys(checks, "")


def test_the_good_miniature_of_frames_passes_every_check() -> None:
    assert judged("server", OF_FRAMES, ALL_CHECKS) == dict.fromkeys(ALL_CHECKS, "")


def test_a_miniature_whose_images_come_late_is_waited_for(tmp_path: Path) -> None:
    """As those of any do on a busy machine."""
    source, sends = OF_IMAGES.read_text("utf-8"), "        send(sock, self.images.init_packet())\n"
    assert source.count(sends) == 1
    late = tmp_path / "late.py"
    late.write_text(source.replace(sends, f"        __import__('time').sleep(1)\n{sends}"), "utf-8")
    checks = {"exports": CHECKS[OF_IMAGES]["check_exports_nothing_but_buffers"]}
    assert judged("server", late, checks) == {"exports": ""}


RECORD = '        cuda("EventRecord", self.event, self.stream)\n'
WRITE_DEPTH = "        self.write(COLOR, depth)\n"
SLOT_RECORD = "            self.images.publish(slot, color, depth)\n"
BROKEN = {
    "never records the event": (
        RECORD,
        "",
        "check_records_the_event_after_the_image",
        "it was never recorded",
    ),
    "records the event on another stream": (
        RECORD,
        RECORD.replace("self.stream", "self.other"),
        "check_records_the_event_after_the_image",
        "behind it; its last record is cudaEventRecord(device 0, stream 3",
    ),
    "records the event between colour and depth": (
        WRITE_DEPTH + RECORD,
        RECORD + WRITE_DEPTH,
        "check_records_the_event_after_the_image",
        "when it had written the colour only",
    ),
    "records the event before it writes": (
        "        self.write(0, color)\n" + WRITE_DEPTH + RECORD,
        RECORD + "        self.write(0, color)\n" + WRITE_DEPTH,
        "check_records_the_event_after_the_image",
        "of the time an image lay there without the event recorded behind it",
    ),
    "records the event once": (
        RECORD,
        '        if not hasattr(self, "once"):\n'
        '            cuda("EventRecord", self.event, self.stream)\n        self.once = 1\n',
        "check_records_the_event_after_the_image",
        "its last record is cudaEventRecord(",
    ),
    "does not record the last image": (
        RECORD,
        '        self.count = getattr(self, "count", 0) + 1\n'
        '        if self.count < 5:\n            cuda("EventRecord", self.event, self.stream)\n',
        "check_records_the_event_after_the_image",
        "in 5 s the event was not once seen recorded behind the last write of the colour and depth",
    ),
    "keeps other things in the allocation": (
        WRITE_DEPTH,
        WRITE_DEPTH + "        self.write(COLOR + DEPTH + 64, bytes(64))\n",
        "check_exports_nothing_but_buffers",
        "holds something else than images: cudaMemcpyAsync(",
    ),
    "exports memory of the host": (
        'made("Malloc", SIZE(COLOR + DEPTH))',
        'made("MallocHost", SIZE(COLOR + DEPTH))',
        "check_exports_nothing_but_buffers",
        "the handle of memory that cannot be exported: cudaIpcGetMemHandle(code 1",
    ),
    "creates an event for one process": (
        "EVENT_FLAGS = INTERPROCESS | DISABLE_TIMING",
        "EVENT_FLAGS = DISABLE_TIMING",
        "check_creates_the_event_with_its_flags",
        "without cudaEventInterprocess it created the event of cudaIpcGetEventHandle(code 400",
    ),
    "creates an event that takes the time": (
        'self.event = made("EventCreateWithFlags", EVENT_FLAGS)',
        'with contextlib.suppress(Bad):\n            made("EventCreateWithFlags", INTERPROCESS)\n'
        '        self.event = made("EventCreateWithFlags", EVENT_FLAGS)',
        "check_creates_the_event_with_its_flags",
        "without cudaEventDisableTiming it called cudaEventCreate(code 1",
    ),
    "makes new memory for each client": (
        "        send(sock, self.images.init_packet())\n",
        "        old, self.images = self.images, Buffers()\n"
        "        send(sock, self.images.init_packet())\n"
        "        time.sleep(0.05)\n        old.free()\n",
        "check_keeps_memory_while_a_connection_is_open",
        "while an IPC connection was open that was sent the handles it called cudaFree(",
    ),
    "frees when the first client goes": (
        "        for _ in packets(sock):\n            pass\n",
        "        for _ in packets(sock):\n            pass\n"
        "        old, self.images = self.images, Buffers()\n"
        "        time.sleep(0.05)\n        old.free()\n",
        "check_keeps_memory_while_a_connection_is_open",
        "while an IPC connection was open that was sent the handles it called cudaFree(",
    ),
    "destroys the event when the first client goes": (
        "        for _ in packets(sock):\n            pass\n",
        "        for _ in packets(sock):\n            pass\n"
        "        old, self.images = self.images, Buffers()\n"
        '        time.sleep(0.05)\n        cuda("EventDestroy", old.event)\n',
        "check_keeps_memory_while_a_connection_is_open",
        "while an IPC connection was open that was sent the handles it called cudaEventDestroy(",
    ),
    "stores numbers big-endian": (
        '    color = array.array("f", row * wall + empty * SKY)\n',
        '    color = array.array("f", row * wall + empty * SKY)\n    color.byteswap()\n',
        "check_numbers_are_little_endian",
        "colours of image 0 are from 0 to 1 if they are read as big-endian",
    ),
    "stores bytes as numbers": (
        "(red, 0.5, 1.0 - red, 1.0)",
        "(255.0 * red, 127.5, 0.0, 255.0)",
        "check_colours_are_from_0_to_1",
        "colours that are not from 0 to 1: ",
    ),
    "stores no alpha": (
        "(red, 0.5, 1.0 - red, 1.0)",
        "(red, 0.5, 1.0 - red, 0.0)",
        "check_alpha_is_1_where_there_is_none",
        "alpha is 0.0 in every pixel of 8 images",
    ),
    "stores 0 where nothing is seen": (
        "[math.inf] * (SKY * WIDTH)",
        "[0.0] * (SKY * WIDTH)",
        "check_empty_pixels_are_infinitely_far",
        "positive nor what is empty: 384 of 1536 in image 0, 0.0 at row 0, column 0",
    ),
    "records the slot's event after the frame": (
        '        cuda("EventRecord", self.events[slot], self.stream)\n'
        '        cuda("StreamSynchronize", self.stream)\n',
        "        def late():\n"
        '            cuda("EventRecord", self.events[slot], self.stream)\n'
        '            cuda("StreamSynchronize", self.stream)\n\n        return late\n',
        "check_records_the_event_before_the_frame",
        "recorded behind the last write to it",
    ),
    "records the event of the first slot always": (
        "self.events[slot], self.stream",
        "self.events[0], self.stream",
        "check_records_the_event_before_the_frame",
        "was not recorded behind the last write to it, cudaMemcpyAsync(",
    ),
    "writes once more behind the event": (
        '        cuda("EventRecord", self.events[slot], self.stream)\n',
        '        cuda("EventRecord", self.events[slot], self.stream)\n'
        "        self.write(slot * COLOR, color[:16])\n",
        "check_records_the_event_before_the_frame",
        "was not recorded behind the last write to it, cudaMemcpyAsync(",
    ),
    "frees the ring when one reader has closed it": (
        '            reader.opened = kind == "opened"',
        '            if kind == "closed":\n                cuda("Free", self.images.memory)\n'
        '            reader.opened = kind == "opened"',
        "check_keeps_memory_while_somebody_has_it",
        "while an IPC connection was open that was sent the handles it called cudaFree(",
    ),
}
ALSO = {
    "records the event on another stream": (
        "        self.stream = made(",
        '        self.other = made("StreamCreateWithFlags", NON_BLOCKING)\n'
        "        self.stream = made(",
    ),
    "records the slot's event after the frame": (
        "            for reader in self.readers:\n                self.lend(reader)\n"
        "            if any(",
        "            for reader in self.readers:\n                self.lend(reader)\n"
        "            late()\n            if any(",
    ),
    "does not record the last image": (
        "            self.images.publish(",
        "            number >= 5 or self.images.publish(",
    ),
    "exports memory of the host": (
        "INTERPROCESS = 1, 1,",
        "INTERPROCESS = 4, 1,",
    ),
    "keeps other things in the allocation": (
        'made("Malloc", SIZE(COLOR + DEPTH))',
        'made("Malloc", SIZE(COLOR + DEPTH + 4096))',
    ),
}
"""What has to be changed beside, for some."""


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_miniature_fails_for_its_reason(name: str, tmp_path: Path) -> None:
    *change, check, reason = BROKEN[name]
    shutil.copy(OF_IMAGES, tmp_path)
    source = next(path for path, checks in CHECKS.items() if check in checks).read_text("utf-8")
    if name == "records the slot's event after the frame":
        source = source.replace(SLOT_RECORD, SLOT_RECORD.replace("self", "late = self"))
    for old, new in (change, *([ALSO[name]] if name in ALSO else [])):
        assert old in source
        source = source.replace(old, new)
    program = tmp_path / "broken.py"
    program.write_text(source, "utf-8")
    assert reason in judged("server", program, {check: ALL_CHECKS[check]})[check]


ALLOWED = {
    "depth first, after all was cleared": (
        "        self.write(0, color)\n" + WRITE_DEPTH,
        '        cuda("Memset", self.memory, 0, SIZE(COLOR + DEPTH))\n'
        + WRITE_DEPTH
        + "        self.write(0, color)\n",
    ),
    "records on another stream after the host has waited": (
        RECORD,
        '        cuda("StreamSynchronize", self.stream)\n'
        '        cuda("EventRecord", self.event, None)\n',
    ),
    "renders only when the camera moves": (
        "            self.images.publish(*draw(number, self.poses))\n",
        "            if number == 0 or self.poses != globals().get('drawn'):\n"
        "                self.images.publish(*draw(number, self.poses))\n"
        "                globals()['drawn'] = dict(self.poses)\n",
    ),
    "is slow from colour to depth": (WRITE_DEPTH, "        time.sleep(0.3)\n" + WRITE_DEPTH),
    "frees memory that it has shown to nobody": (
        "        number = 0\n",
        "        number = 0\n        Buffers().free()\n",
    ),
    "events that do not spin": ("EVENT_FLAGS = INTERPROCESS", "EVENT_FLAGS = 1 | INTERPROCESS"),
    "room at both ends": (
        'made("Malloc", SIZE(COLOR + DEPTH))',
        'made("Malloc", SIZE(COLOR + DEPTH + 4096))',
    ),
    "100 where nothing is seen": ("[math.inf] * (SKY", "[100.0] * (SKY"),
}


@pytest.mark.parametrize("name", ALLOWED)
def test_what_is_allowed_passes(name: str, tmp_path: Path) -> None:
    old, new = ALLOWED[name]
    source = OF_IMAGES.read_text("utf-8")
    assert old in source
    program = tmp_path / "allowed.py"
    program.write_text(source.replace(old, new), "utf-8")
    found = judged("server", program, CHECKS[OF_IMAGES])
    assert {check: why for check, why in found.items() if why} == {}


def test_every_check_has_a_miniature_that_fails_it() -> None:
    assert {check for _, _, check, _ in BROKEN.values()} == set(ALL_CHECKS)
