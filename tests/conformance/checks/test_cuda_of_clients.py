"""The checks of device memory: the good miniature passes, each broken one fails for its reason."""

import shutil
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from splatbus_conformance.checks.v1_0.buf import clients as events
from splatbus_conformance.checks.v1_0.cud import clients as device
from splatbus_conformance.checks.v1_0.ini import device as device_packets
from splatbus_conformance.checks.v1_1.img import clients as releases
from splatbus_conformance.checks.v1_1.img import reading
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.checks.v1_0.cud import clients as device
from splatbus_conformance.checks.v1_1.img import clients_device
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.device_listener import DeviceListener
from splatbus_conformance.trials.moves.exchanges.exchange import STRANGER
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet

from tests.conformance.images.cuda_stand_in.library import checks_in, judged

pytestmark = pytest.mark.apart

MINIATURES = Path(__file__).parents[1] / "miniatures"
OF_IMAGES, OF_FRAMES = MINIATURES / "cuda_client.py", MINIATURES / "cuda_frames.py"
OF_A_RING = (
    "check_releases_each_frame_once",
    "check_reads_a_frame_after_its_event",
    "check_releases_when_it_has_read",
    "check_reads_only_what_it_holds",
)
OF_ANY_MEMORY = checks_in(releases, reading)
CHECKS = {
    OF_IMAGES: checks_in(events, device, device_packets),
    OF_FRAMES: {name: OF_ANY_MEMORY[name] for name in OF_A_RING},
}
OF_PACKETS = {
    it.name: it
    for it in checks_of("client")
    if "device" in it.places and it.requirement.startswith(("FRM", "INI", "JSN"))
}
CHECKS = {OF_IMAGES: checks_in(device) | OF_PACKETS, OF_FRAMES: checks_in(clients_device)}
ALL_CHECKS = CHECKS[OF_IMAGES] | CHECKS[OF_FRAMES]


@pytest.mark.parametrize("miniature", CHECKS, ids=lambda path: path.stem)
def test_the_good_miniature_passes_every_check(miniature: Path) -> None:
    checks = CHECKS[miniature]
    assert judged("client", miniature, checks) == dict.fromkeys(checks, "")


BROKEN = {
    "does not wait for the event": (
        'cuda("StreamWaitEvent", self.stream, self.event, 0)',
        "pass",
        "check_reads_no_image_before_its_event",
        "while the event was pending it called",
    ),
    "waits for the event once": (
        'cuda("StreamWaitEvent", self.stream, self.event, 0)',
        'hasattr(self, "waited") or cuda("StreamWaitEvent", self.stream, self.event, 0)\n'
        "        self.waited = True",
        "check_reads_no_image_before_its_event",
        "its stream did not wait for the event before cudaMemcpy2DAsync",
    ),
    "waits on another stream": (
        'cuda("StreamWaitEvent", self.stream, self.event, 0)',
        'cuda("StreamWaitEvent", None, self.event, 0)',
        "check_reads_no_image_before_its_event",
        "its stream did not wait for the event before cudaMemcpy2DAsync",
    ),
    "copies depth on a stream that waits for nothing": (
        "DEVICE_TO_HOST, self.stream)",
        'DEVICE_TO_HOST, made("StreamCreateWithFlags", NON_BLOCKING)'
        ' if what == "depth" else self.stream)',
        "check_reads_no_image_before_its_event",
        "its stream did not wait for the event before cudaMemcpy2DAsync",
    ),
    "opens the handle of depth again by its offset": (
        'base = self.open(packet[f"mem_{what.lower()}"])',
        'int(meta.get("offsetDepth", 0)) % 256 and self.opened.clear()\n'
        '                base = self.open(packet[f"mem_{what.lower()}"])',
        "check_opens_each_handle_once",
        "it had the memory open when it called cudaIpcOpenMemHandle",
    ),
    "opens the same handle twice": (
        "if text not in self.opened:",
        "if True:",
        "check_opens_each_handle_once",
        "it had the memory open when it called cudaIpcOpenMemHandle",
    ),
    "closes the connection and reads on": (
        "keep(image, image.read())",
        "sock.close()\n"
        "                for _ in range(300):\n"
        "                    image.read()\n"
        "                    time.sleep(0.01)\n"
        "                return",
        "check_keeps_the_ipc_connection_while_it_reads",
        "it reads on after it closed the IPC connection",
    ),
    "never closes memory": (
        'cuda("IpcCloseMemHandle", pointer)',
        "pass",
        "check_gives_memory_back",
        "5 s after its connection it holds memory",
    ),
    "never destroys the event": (
        'cuda("EventDestroy", self.event)',
        "pass",
        "check_gives_memory_back",
        "s after its connection it holds the event",
    ),
    "closes while copies are under way": (
        'cuda("StreamSynchronize", self.stream)',
        "pass",
        "check_gives_memory_back",
        "it had not seen its copies finish when it called cudaIpcCloseMemHandle",
    ),
    "opens on device 0 always": (
        'cuda("SetDevice", int(meta.get("device", 0)))',
        "pass",
        "check_opens_on_the_device_named",
        "meta.device is 1; it called cudaIpcOpenMemHandle",
    ),
    "opens on device 0 whatever is named": (
        'cuda("SetDevice", int(meta.get("device", 0)))',
        "pass",
        "check_opens_nothing_on_another_device",
        "it reads an image that is said to lie on device 99",
    ),
    "opens the event on device 0 always": (
        'self.event = made("IpcOpenEventHandle"',
        'cuda("SetDevice", 0)\n            self.event = made("IpcOpenEventHandle"',
        "check_opens_on_the_device_named",
        "meta.device is 1; it called cudaIpcOpenEventHandle(device 0",
    ),
    "stays on the last device": (
        'cuda("SetDevice", int(meta.get("device", 0)))',
        'cuda("SetDevice", int(meta["device"])) if "device" in meta else None',
        "check_opens_on_the_device_named",
        "meta.device is absent; it called cudaIpcOpenMemHandle(device 1",
    ),
    "reads on without its connection": (
        "        if image:\n            image.close()\n\n",
        "        for _ in range(900 if image else 0):\n"
        "            image.read()\n            time.sleep(0.01)\n\n",
        "check_leaves_the_buffers_of_an_ended_connection",
        "5 s after its connection ended it called",
    ),
    "believes every image to have the size of the first": (
        'self.width, self.height = int(meta["w"]), int(meta["h"])',
        "self.width, self.height = 64, 48",
        "check_reads_the_new_memory",
        "memory of 31x17 after a reconnect",
    ),
    "reads the memory of before as well": (
        "keep(image, image.read())",
        "keep(image, image.read())\n"
        '                seen = globals().setdefault("seen", {})\n'
        "                for text in set(image.opened) - set(seen):\n"
        '                    seen[text] = made("IpcOpenMemHandle", handle(text), 1)\n'
        "                for pointer in seen.values():\n"
        '                    cuda("Memcpy", bytes(16), pointer, SIZE(16), DEVICE_TO_HOST)',
        "check_reads_the_new_memory",
        "on the new connection it called cudaMemcpy(",
    ),
    "takes an absent offset for one": (
        'meta.get(f"offset{what}", 0)',
        'meta.get(f"offset{what}", 16)',
        "check_reads_what_the_packet_names",
        "an init packet with no offsets: reading the image whole",
    ),
    "ignores offsets": (
        'begin = base + int(meta.get(f"offset{what}", 0))',
        "begin = base",
        "check_reads_what_the_packet_names",
        "an init packet with depth before colour in one allocation: reading the image whole",
    ),
    "does not look at the pitch": (
        'whole(meta["pitchColor"], 16 * w, 16 * w)',
        "True",
        "check_refuses_broken_init_packets",
        "the testee took it as valid",
    ),
    "takes base64 as it comes": (
        "len(h) == 88 and len(base64.b64decode(h, validate=True)) == 64",
        "len(base64.b64decode(h)) == 64",
        "check_refuses_broken_init_packets",
        "(INI-7): the testee took it as valid",
    ),
    "reads one packet a connection, and dies of a broken one": (
        'elif packet and "meta" in packet and "type" not in packet and is_good(packet):',
        'elif packet and image is None and "meta" in packet and (is_good(packet) or os.abort()):',
        "check_refuses_broken_init_packets",
        "the testee died",
    ),
    "reads text as leniently as its language does": (
        "value = json.loads(payload.decode(), parse_float=finite, parse_int=finite, **strict)",
        "return json.loads(payload)",
        "check_does_not_act_on_broken_text",
        "the testee took it as valid",
    ),
    "hears nothing after a broken text": (
        "with contextlib.suppress(ValueError, RecursionError):",
        "try:\n                read(payload)\n"
        "            except (ValueError, RecursionError):\n                time.sleep(600)\n"
        "            else:",
        "check_handles_the_next_packet",
        "device: the packet after",
    ),
    "takes what has a type for an init packet": (
        'and "type" not in packet ',
        "",
        "check_ignores_what_is_no_init_packet",
        "the testee took it as valid",
    ),
    "handles one packet a read": (
        "                    yield message\n",
        "                    yield message\n            break\n",
        "check_any_segmentation",
        "device: 3 packets of",
    ),
    "goes on with half a packet on the next connection": (
        "            return\n        data += chunk",
        '            globals()["kept"] = data\n            return\n'
        '        data = globals().pop("kept", b"") + data + chunk',
        "check_half_packet_is_discarded",
        "device: a connection that ends",
    ),
    "takes integers without a fraction only": (
        "number = isinstance(value, int | float)",
        "number = isinstance(value, int)",
        "check_takes_any_spelling",
        "of device memory: the testee ignored it",
    ),
    "knows all members that there may be": (
        'if packet and "meta" in packet and',
        'if packet and "meta" in packet and len(packet) == 4 and',
        "check_ignores_unknown_members",
        "of device memory: the testee ignored it",
    ),
    "dies on an unknown handle": (
        'raise Bad(f"cuda{name}: {code}")',
        "os._exit(7)",
        "check_goes_on_without_images",
        "the testee exited",
    ),
    "aborts on an unknown handle": (
        'raise Bad(f"cuda{name}: {code}")',
        "os.abort()",
        "check_goes_on_without_images",
        "the testee died",
    ),
    "does not wait for the event of the slot": (
        'cuda("StreamWaitEvent", self.stream, self.events[slot], 0)',
        "pass",
        "check_reads_a_frame_after_its_event",
        "was pending when it called cudaMemcpyAsync",
    ),
    "waits for the event of the first slot always": (
        "self.events[slot], 0)",
        "self.events[0], 0)",
        "check_reads_a_frame_after_its_event",
        "was pending when it called cudaMemcpyAsync",
    ),
    "releases every other frame": (
        'send(sock, {"type": "release", **release})',
        'send(sock, {"type": "release", **release}) if message["slot"] else None',
        "check_releases_each_frame_once",
        "was not released within 5 s",
    ),
    "releases what it still reads": (
        '        cuda("StreamSynchronize", self.stream)\n\n',
        "\n",
        "check_releases_when_it_has_read",
        "frame 1 was released before the host saw the end of cudaMemcpyAsync",
    ),
    "reads once more after the release": (
        'send(sock, {"type": "release", **release})',
        'send(sock, {"type": "release", **release}); __import__("time").sleep(0.05); '
        'reader.read(message["slot"])',
        "check_reads_only_what_it_holds",
        "without a lease of slot",
    ),
    "reads the slot before": (
        'reader.read(message["slot"])',
        'reader.read(message["slot"] - 1)',
        "check_reads_only_what_it_holds",
        "without a lease of slot",
    ),
}


UNUSUAL = {
    "reads one packet a connection": (
        "elif packet and ",
        "elif packet and image is None and ",
    ),
    "closes on what is broken": (
        "with contextlib.suppress(ValueError, RecursionError):",
        "if True:",
    ),
}


@pytest.mark.parametrize("name", UNUSUAL)
def test_an_unusual_miniature_fails_no_check(name: str, tmp_path: Path) -> None:
    old, new = UNUSUAL[name]
    source = OF_IMAGES.read_text("utf-8")
    assert old in source
    program = tmp_path / "unusual.py"
    program.write_text(source.replace(old, new), "utf-8")
    found = judged("client", program, CHECKS[OF_IMAGES])
    failed = {check: what for check, what in found.items() if what and "skipped" not in what}
    assert not failed


def test_who_opens_one_image_a_connection_is_shown_nothing_after_it(tmp_path: Path) -> None:
    """It looks at nothing there, so a broken packet that came later would show nothing."""
    old, new = UNUSUAL["reads one packet a connection"]
    program = tmp_path / "one_image.py"
    program.write_text(OF_IMAGES.read_text("utf-8").replace(old, new), "utf-8")

    def play(trial: ClientTrial) -> None:
        with ExitStack() as held:
            listening = DeviceListener(trial, held)
            assert listening.outcome_of(packet(encode(STRANGER))) == "ignores"
            unseen = listening.image()
            listening.outcome_of(packet(encode(unseen.init_packet())), later=True)
            trial.expect(unseen.opened(trial.calls()), "unseen", "it was not seen")
            trial.delivered += 1

    name = "check_refuses_broken_init_packets"
    assert judged("client", program, {name: replace(ALL_CHECKS[name], play=play)}) == {name: ""}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_miniature_fails_for_its_reason(name: str, tmp_path: Path) -> None:
    old, new, check, reason = BROKEN[name]
    shutil.copy(OF_IMAGES, tmp_path)
    source = next(path for path, checks in CHECKS.items() if check in checks).read_text("utf-8")
    assert old in source
    program = tmp_path / "broken.py"
    program.write_text(source.replace(old, new), "utf-8")
    assert reason in judged("client", program, {check: ALL_CHECKS[check]})[check]


def test_every_check_has_a_miniature_that_fails_it() -> None:
    assert {check for _, _, check, _ in BROKEN.values()} == set(ALL_CHECKS)
