"""The smallest adapter: no client beside it, every answer by hand. Tests break it in places."""

import json
import sys

GREETING = {
    "adapter": "1",
    "client": {"name": "miniature", "version": "0"},
    "axes": "unity",
    "unitsPerMetre": 1,
    "precision": "single",
    "can": ["start", "stop", "init_packet", "pixels", "digest"],
}
NOTHING = {
    "start": {},
    "stop": {},
    "init_packet": {"images": None},
    "pixels": {"seq": None},
    "digest": {"seq": None},
}


def say(message):
    print(json.dumps(message), flush=True)


say(GREETING)
for line in sys.stdin:
    command = json.loads(line)
    number, name = command["id"], command["command"]
    if name not in NOTHING:
        say({"id": number, "error": f"no command {name}"})
        continue
    say({"id": number, **NOTHING[name]})
    if name == "stop":
        break
