"""The init packet's members of 1.0."""

from tests.conformance.rules.talk import INIT, changed, ipc, server

TALKS = {
    "a sound one": (ipc(server(INIT)), ""),
    "padded rows": (ipc(server(changed(INIT, "/meta/pitchColor", 1040))), "INI-4"),
    "a packet with nothing of one": (ipc(server({"type": "later", "memory": {}})), ""),
}
