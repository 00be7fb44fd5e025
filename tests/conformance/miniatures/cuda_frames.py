"""A small client of 1.1 that reads frames out of CUDA memory, and of 1.0 where its server is."""

import threading

import cuda_client
from cuda_client import (
    DEVICE_TO_HOST,
    LAZY_PEER_ACCESS,
    POINTER,
    SIZE,
    Bad,
    Image,
    ctypes,
    cuda,
    handle,
    made,
    packets,
    send,
)

HELLO = {
    "type": "hello",
    "versions": ["1.1", "1.0"],
    "client": {"name": "miniature", "version": "1"},
    "capabilities": ["cuda_ipc", "frames"],
}


class Ring:
    """The slots that an init packet of 1.1 names."""

    def __init__(self, packet):
        meta, self.ring = packet["meta"], packet["ring"]
        self.height = int(meta["h"])
        self.pixels = int(meta["w"]) * int(meta["h"])
        cuda("SetDevice", int(meta.get("device", 0)))
        self.stream = made("StreamCreateWithFlags", 1)
        self.memory = made("IpcOpenMemHandle", handle(packet["memory"]["handle"]), LAZY_PEER_ACCESS)
        self.events = [made("IpcOpenEventHandle", handle(text)) for text in self.ring["events"]]

    def read(self, slot):
        cuda("StreamWaitEvent", self.stream, self.events[slot], 0)
        found = {}
        for what, size in (("color", 16 * self.pixels), ("depth", 4 * self.pixels)):
            begin = self.ring[f"{what}Offset"] + slot * self.ring[f"{what}Stride"]
            found[what] = ctypes.create_string_buffer(size)
            place = found[what], POINTER(self.memory.value + begin)
            cuda("MemcpyAsync", *place, SIZE(size), DEVICE_TO_HOST, self.stream)
        cuda("StreamSynchronize", self.stream)

        return {what: data.raw for what, data in found.items()}

    def close(self):
        cuda("IpcCloseMemHandle", self.memory)
        for event in self.events:
            cuda("EventDestroy", event)
        cuda("StreamDestroy", self.stream)


def ipc(sock):
    send(sock, HELLO)
    offered = reader = granted = None
    try:
        for message in packets(sock):
            if message is None:
                if isinstance(reader, Image):
                    cuda_client.saw(None, reader.read(), reader.height)
            elif message.get("type") == "welcome":
                granted = message["capabilities"]
            elif message.get("type") == "frame" and reader:
                read = reader.read(message["slot"])
                cuda_client.saw(message["seq"], read, reader.height)
                release = {"generation": message["generation"], "seq": message["seq"]}
                send(sock, {"type": "release", **release})
            elif "meta" in message and "version" not in message:
                reader = Image(message)
            elif "meta" in message and message["memory"]["kind"] == "cuda_ipc":
                offered = message
            if offered and granted and not reader:
                answer = {"type": "opened", "generation": offered["generation"]}
                try:
                    reader = Ring(offered)
                except Bad as bad:
                    answer |= {"type": "open_failed", "reason": str(bad)}
                offered = None
                send(sock, answer)
    finally:
        if reader:
            reader.close()


if __name__ == "__main__":
    message = {"target": cuda_client.stay, "args": (cuda_client.MSG, cuda_client.msg)}
    threading.Thread(**message, daemon=True).start()
    cuda_client.stay(cuda_client.IPC, ipc)
