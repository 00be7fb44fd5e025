"""The harness's side of the adapter protocol: good shims are heard, broken ones named as such."""

import json
import re
import sys
from contextlib import ExitStack, closing
from pathlib import Path

import jsonschema
import pytest
from splatbus_conformance.data import read_json
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.trials.testee.adapter import Adapted, AdapterBroken, ClientCrashed
from splatbus_conformance.trials.testee.adapter_smoke import smoke
from splatbus_conformance.wire.messages import ring_bytes
from splatbus_conformance.wire.sockets import CHANNELS, Peer

from tests.conformance.harness import said

PAGE = Path(__file__).parents[4] / "conformance" / "ADAPTER.md"
MINIATURE = Path(__file__).parents[2] / "miniatures" / "adapter.py"
EXAMPLE = PAGE.parents[1] / "reference_client" / "splatbus_viewer" / "adapter.py"
PATIENCE, BRIEFLY = 30.0, 0.5
SCHEMA = read_json("adapter.schema.json")


@pytest.fixture
def start(tmp_path):
    """Makes an adapter of the miniature, or another, with one piece of its text replaced, and a
    peer for its client; ends both after the test.
    """
    with ExitStack() as held:

        def start(old="", new="", patience=10.0, source=MINIATURE):
            text, path = Path(source).read_text("utf-8"), tmp_path / "adapter.py"
            assert old in text
            path.write_text(text.replace(old, new, 1) if old else text, "utf-8")
            peer = held.enter_context(closing(Peer("127.0.0.1", {"ipc": 0, "msg": 0})))
            for channel in CHANNELS:
                peer.listen(channel)
            command = f'"{sys.executable}" "{path}"'
            adapted = Adapted(command, peer.environment(), peer, patience)
            return held.enter_context(closing(adapted))

        yield start


def test_a_good_adapter_is_heard(start):
    adapted = start()
    assert adapted.ensure_running()
    assert not adapted.ensure_running()
    assert adapted.greeting.client == "miniature 0"
    assert adapted.greeting.single
    assert adapted.ask("digest")["seq"] is None
    assert adapted.ended() is None
    assert adapted.stop().status == 0
    assert adapted.ensure_running()
    assert adapted.ask("pixels", at=[[0, 0]])["seq"] is None


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("say(GREETING)\n", "import time\ntime.sleep(60)\n", "silent for 0.5 s: its first line"),
        ("say(GREETING)\n", "print('Loading scene', flush=True)\n", "no JSON: Loading scene"),
        ("say(GREETING)\n", "raise OSError('no engine')\n", "OSError: no engine"),
        ('"axes": "unity"', '"axes": "maya"', '/axes: "maya" is not one of'),
        ('"precision": "single",', "", '"precision" is a required property'),
        (
            "print(json.dumps(message)",
            "print('{\"axes\": 1e400}'",
            "in place of its first line, is no JSON",
        ),
    ],
)
def test_a_broken_first_line_is_the_adapters_fault(start, old, new, reason):
    with pytest.raises(AdapterBroken, match="the adapter is broken: ") as broken:
        start(old, new, BRIEFLY if "silent" in reason else PATIENCE).open()
    assert reason in str(broken.value)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('say({"id": number, **', "say({**", "has the id None, not 1"),
        (
            "    command = json",
            "    print('[1]')\n    command = json",
            "its answer to digest is no JSON object",
        ),
        ('"digest": {"seq": None}', '"digest": {"seq": "\\ud800"}', "surrogates not allowed"),
        (
            '"digest": {"seq": None}',
            '"digest": {"seq": json.loads("[" * 400 + "]" * 400)}',
            "Recursion limit",
        ),
        (
            '"digest": {"seq": None}',
            '"digest": {"seq": 1, "color": "ab", "depth": None}',
            '/color: "ab" does not match',
        ),
        ("if name not in NOTHING:", "if True:", "answered the error 'no command digest'"),
        (
            "    command = json",
            "    sys.exit()\n    command = json",
            "ended with status 0 in place",
        ),
    ],
)
def test_a_broken_answer_is_the_adapters_fault(start, old, new, reason):
    adapted = start(old, new)
    adapted.open()
    with pytest.raises(AdapterBroken) as broken:
        adapted.ask("digest")
    assert reason in str(broken.value)


def test_an_adapter_that_hangs_is_given_up_and_ended(start):
    adapted = start("    command = json", "    import time\n    time.sleep(60)\n    command = json")
    adapted.open()
    with pytest.raises(
        AdapterBroken, match=r"silent for 0\.2 s: its answer to digest did not come"
    ):
        adapted.ask("digest", 0.2)
    assert adapted.stop() is not None
    assert adapted.ended() is None, "nothing runs any more"


def test_an_adapter_that_reads_nothing_does_not_hold_up_the_harness(start):
    adapted = start("for line in sys.stdin:", "import time\ntime.sleep(60)\nfor line in sys.stdin:")
    adapted.open()
    with pytest.raises(AdapterBroken, match="silent"):
        adapted.ask("pixels", 0.2, at=[[x, y] for x in range(300) for y in range(300)])


@pytest.mark.parametrize("how", ["import os\n    os.abort()", "sys.exit(134)"])
def test_a_crash_is_the_clients(start, how):
    """A status above 128 tells of one too."""
    adapted = start("    command = json", f"    {how}\n    command = json")
    adapted.open()
    with pytest.raises(ClientCrashed, match="in place of its answer to digest"):
        adapted.ask("digest")
    assert adapted.ended().crashed


# The smoke test


def tried(adapted):
    with HostMemory(ring_bytes(16, 12, 3)) as memory:
        smoke(adapted, adapted._peer, ScriptedServer(memory, 16, 12))


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("if name not in NOTHING:", "if False:", "KeyError"),
        (
            'say({"id": number, "error": f"no command {name}"})',
            'say({"id": number})',
            "a command that nobody knows was not answered by an error",
        ),
        ("        break", "        sys.exit(7)", "after stop it ended with status 7"),
        ('"init_packet": {"images": None}', '"init_packet": {}', '"images" is a required property'),
    ],
)
def test_a_broken_miniature_is_found_out(start, old, new, reason):
    with pytest.raises(AdapterBroken) as broken:
        tried(start(old, new))
    assert reason in str(broken.value)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('image.astype("<f4")', 'image[::-1].astype("<f4")', "its digest of color does not fit"),
        ("for x, y in at]\n        depth", "for x, y in at[1:]]\n        depth", "it told"),
        ('return {"replies": [', 'return {"replies": [][:0] and [', "in that order"),
        (
            'if name == "stop"',
            'if name == "subscribe"',
            "ended with status 0 in place of its answer to",
        ),
        ('{"width": reply[0]', '{"size": reply[0]', "its answer to ask breaks its schema"),
    ],
)
def test_a_broken_shim_beside_a_good_client_is_found_out(start, old, new, reason):
    with pytest.raises(AdapterBroken) as broken:
        tried(start(old, new, source=EXAMPLE))
    assert reason in str(broken.value)


def test_a_wrong_client_or_none_is_none_of_its_business(start):
    tried(start())
    wrong = "pose = Pose(tuple(position)", "pose = Pose(tuple(-n for n in position)"
    tried(start(*wrong, source=EXAMPLE))


def test_the_command_says_that_the_adapter_is_broken(tmp_path):
    path = tmp_path / "adapter.py"
    path.write_text("print('hello')\n", "utf-8")
    code, output = said("client", "--adapter", f'"{sys.executable}" "{path}"')
    assert code == 3, output
    assert "no verdict: the adapter is broken: " in output


# The page


def examples():
    """Each command of the page, with its answer."""
    for name, block in re.findall(r"```json (\w+)\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL):
        yield name, block.splitlines()


def conforms(text, name):
    schema = {**SCHEMA, "$ref": f"#/$defs/{name}"}
    jsonschema.Draft202012Validator(schema).validate(json.loads(text))


def test_the_page_shows_every_command_with_its_answer():
    shown = dict(examples())
    conforms(shown.pop("greeting")[0], "greeting")
    assert set(shown) == set(SCHEMA["$defs"]["commands"]) == set(SCHEMA["$defs"]["answers"])
    for name, (command, answer) in shown.items():
        conforms(command, f"commands/{name}")
        conforms(answer, f"answers/{name}")
        assert json.loads(command)["command"] == name
        assert json.loads(command)["id"] == json.loads(answer)["id"]
