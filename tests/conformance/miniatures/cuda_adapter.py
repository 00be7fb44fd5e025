"""An adapter beside the miniature of `cuda_frames.py`, which tells what it has read."""

import hashlib
import json
import sys
import threading

import cuda_client
import cuda_frames

GREETING = {
    "adapter": "1",
    "client": {"name": "miniature", "version": "1"},
    "axes": "opencv",
    "unitsPerMetre": 1,
    "precision": "double",
    "can": ["start", "stop", "digest"],
}
newest = {"seq": None}


def digest(planes, rows):
    def rows_from_the_top(data):
        row = len(data) // rows
        return b"".join(data[row * r : row * (r + 1)] for r in reversed(range(rows)))

    return {what: hashlib.sha256(rows_from_the_top(it)).hexdigest() for what, it in planes.items()}


def saw(seq, planes, rows):
    global newest
    newest = {"seq": newest["seq"] or 0 if seq is None else seq, **digest(planes, rows)}


def start():
    cuda_client.saw = saw
    for port, talk in ((cuda_client.MSG, cuda_client.msg), (cuda_client.IPC, cuda_frames.ipc)):
        threading.Thread(target=cuda_client.stay, args=(port, talk), daemon=True).start()
    return {}


print(json.dumps(GREETING), flush=True)
for line in sys.stdin:
    command = json.loads(line)
    name = command["command"]
    commands = {"start": start, "stop": dict, "digest": lambda: newest}
    answer = commands[name]() if name in commands else {"error": f"no command {name}"}
    print(json.dumps({"id": command["id"], **answer}), flush=True)
    if name == "stop":
        break
