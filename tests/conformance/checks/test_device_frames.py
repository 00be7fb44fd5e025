"""The checks that see only what a client shows: good miniatures pass, broken ones fail for it."""

import shutil
from pathlib import Path

import pytest
from splatbus_conformance.checks.v1_0.buf import clients as events
from splatbus_conformance.checks.v1_0.cud import clients as device
from splatbus_conformance.checks.v1_1 import opn
from splatbus_conformance.checks.v1_1.img import reading

from tests.conformance.images.cuda_stand_in.library import checks_in, judged

MINIATURES = Path(__file__).parents[1] / "miniatures"
ADAPTER = "cuda_adapter.py"
CHECKS = {
    name: check
    for name, check in checks_in(events, device, opn, reading).items()
    if check.side == "client" and "device" in check.needs
}


def test_the_good_miniature_passes_every_check() -> None:
    found = judged("client", MINIATURES / ADAPTER, CHECKS, adapter=True)
    assert found == dict.fromkeys(CHECKS, "")


BROKEN = {
    "does not wait for the event": (
        "cuda_client.py",
        'cuda("StreamWaitEvent", self.stream, self.event, 0)',
        "pass",
        "check_reads_no_image_before_its_event",
        "it shows what the memory held while the event was pending",
    ),
    "ignores offsets": (
        "cuda_client.py",
        'begin = base + int(meta.get(f"offset{what}", 0))',
        "begin = base",
        "check_reads_what_the_packet_names",
        "an init packet with depth before colour in one allocation: reading the image whole",
    ),
    "takes an absent offset for one": (
        "cuda_client.py",
        'meta.get(f"offset{what}", 0)',
        'meta.get(f"offset{what}", 16)',
        "check_reads_what_the_packet_names",
        "an init packet with no offsets: reading the image whole",
    ),
    "keeps the size of the first image": (
        "cuda_client.py",
        'self.width, self.height = int(meta["w"]), int(meta["h"])',
        "self.width, self.height = 64, 48",
        "check_reads_the_new_memory",
        "memory of 31x17 after a reconnect",
    ),
    "opens on device 0 always": (
        "cuda_client.py",
        'cuda("SetDevice", int(meta.get("device", 0)))',
        'cuda("SetDevice", 0)',
        "check_opens_nothing_on_another_device",
        "it reads an image that is said to lie on device 99",
    ),
    "does not wait for the event of the slot": (
        "cuda_frames.py",
        'cuda("StreamWaitEvent", self.stream, self.events[slot], 0)',
        "pass",
        "check_reads_a_frame_after_its_event",
        "image 1 was read and was released before the event of slot 1 was complete",
    ),
    "waits for the event of the first slot always": (
        "cuda_frames.py",
        "self.events[slot], 0)",
        "self.events[0], 0)",
        "check_reads_a_frame_after_its_event",
        "before the event of slot 1 was complete",
    ),
    "reads the slot before": (
        "cuda_frames.py",
        'reader.read(message["slot"])',
        'reader.read(message["slot"] - 1)',
        "check_releases_when_it_has_read",
        "its color is what the slot held only while nobody was to read it",
    ),
    "reads 16 bytes too far": (
        "cuda_frames.py",
        "self.memory.value + begin)",
        "self.memory.value + begin + 16 * (what == 'color'))",
        "check_releases_when_it_has_read",
        "its color is of no image whole",
    ),
    "releases before it reads": (
        "cuda_frames.py",
        'read = reader.read(message["slot"])',
        'send(sock, {"type": "release", "generation": 1, "seq": message["seq"]})\n'
        '                read = (__import__("time").sleep(0.05), reader.read(message["slot"]))[1]',
        "check_releases_when_it_has_read",
        "was released before it was read",
    ),
    "shows what it does not hold": (
        "cuda_frames.py",
        'send(sock, {"type": "release", **release})',
        'send(sock, {"type": "release", **release}); __import__("time").sleep(0.05); '
        'cuda_client.saw(message["seq"], reader.read(message["slot"]), reader.height)',
        "check_reads_only_what_it_holds",
        "was shown after the client had given image",
    ),
    "says that it has opened what it has not": (
        "cuda_frames.py",
        'answer |= {"type": "open_failed", "reason": str(bad)}',
        "pass",
        "check_goes_on_without_device_memory",
        "an init packet with an unknown handle of memory: the testee took it as valid",
    ),
    "refuses good device memory": (
        "cuda_frames.py",
        '        meta, self.ring = packet["meta"], packet["ring"]\n',
        '        meta, self.ring = packet["meta"], packet["ring"]\n        raise Bad("no")\n',
        "check_opens_device_memory",
        "it did not open good device memory: no",
    ),
}


@pytest.mark.apart
@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_miniature_fails_for_its_reason(name: str, tmp_path: Path) -> None:
    file, old, new, check, reason = BROKEN[name]
    for miniature in MINIATURES.glob("cuda_*.py"):
        shutil.copy(miniature, tmp_path)
    source = (tmp_path / file).read_text("utf-8")
    assert old in source
    (tmp_path / file).write_text(source.replace(old, new), "utf-8")
    found = judged("client", tmp_path / ADAPTER, {check: CHECKS[check]}, adapter=True)
    assert reason in found[check]
