"""A server of SplatBus 1.1 around a small rasteriser: a thread for each direction of each connection."""

import array
import fcntl
import glob
import itertools
import json
import math
import mmap
import os
import queue
import signal
import socket
import struct
import sys
import threading
import time

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import splats
from reading import SAFE, Wrong, hello_in, lens_in, parsed, pose_in, real, text_of, whole

W, H, SLOTS, READERS, MOST = 40, 30, 7, 5, 8
LENS = {"fx": 34.0, "fy": 34.0, "cx": W / 2, "cy": H / 2, "width": W, "height": H, "near": 0.05, "far": 500.0}
CAMERAS = [((0.0, 0.0, -5.0), (0.0, 0.0, 0.0, 1.0)), ((5.0, -0.5, 0.0), (0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5)))]
LATER = os.environ.get("SIMULATES") == "1.2"  # what that might be: a capability, its message, a member of `frame`
VERSIONS = ["1.2", "1.1", "1.0"] if LATER else ["1.1", "1.0"]
CAN = {"ipc": {"host_shm", "frames"}, "msg": {"intrinsics", "objects", "scene"}}
COLOR, DEPTH = 16 * W * H, 4 * W * H
BYTES = SLOTS * (COLOR + DEPTH)
GENERATION = 1


# ---- memory


def memory():
    for path in glob.glob("/dev/shm/cloud-of-splats-*"):
        try:
            if os.path.exists(f"/proc/{path.rsplit('-', 1)[1]}"):
                time.sleep(0.3)  # its maker may not have locked it yet
            with open(path, "rb") as left:
                fcntl.flock(left, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.unlink(path)
        except OSError:
            pass
    name = f"cloud-of-splats-{os.getpid()}"
    file = os.open(f"/dev/shm/{name}", os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    fcntl.flock(file, fcntl.LOCK_EX)
    os.posix_fallocate(file, 0, BYTES)
    view = mmap.mmap(file, BYTES)
    view[:] = bytes(BYTES)
    return name, view


class World:
    """What is drawn, what was drawn last, and who may say so."""

    def __init__(self):
        self.name, self.view = memory()
        self.changed = threading.Condition()
        self.camera, self.poses, self.lens = CAMERAS[0], {}, LENS
        self.number, self.tag, self.exposure = 0, None, 0.0
        self.steering, self.readers = [], set()
        self.image, self.dirty = None, True
        self.steps = itertools.count(1)

    def init_packet(self):
        ring = {"slots": SLOTS, "colorOffset": 0, "colorStride": COLOR + DEPTH, "depthOffset": COLOR, "depthStride": COLOR + DEPTH}
        meta = {"w": W, "h": H, "fmtColor": "RGBA32F", "pitchColor": 16 * W, "fmtDepth": "R32F", "pitchDepth": 4 * W}
        depth = {"kind": "planar_z", "estimator": "expected", "empty": "inf"}
        return {
            "version": VERSIONS[0], "generation": GENERATION, "meta": meta, "ring": ring,
            "memory": {"kind": "host_shm", "name": self.name, "bytes": BYTES},
            "semantics": {"rows": "bottom_up", "alpha": "premultiplied", "colorSpace": "srgb", "depth": depth, "unitMetres": None, "origin": [0, 0, 0]},
        }

    def take(self, conn, kind, value, extra=None):
        """A valid pose of a connection: whether it has control."""
        conn.said[kind] = (value, extra, next(self.steps))
        if conn not in self.steering:
            self.steering.append(conn)
        if self.steering[0] is conn:
            self.put(conn, kind, value, extra)
        return self.steering[0] is conn

    def put(self, conn, kind, value, extra):
        before = self.camera, self.poses.get(kind, splats.REST), self.lens
        if kind is None:
            lens, tag = extra
            conn.lens = lens or conn.lens
            self.camera, self.lens = value, conn.lens or LENS
            self.number, self.tag = next(self.steps), tag
        else:
            self.poses[kind] = value
        if before != (self.camera, self.poses.get(kind, splats.REST), self.lens):
            self.dirty = True
            self.changed.notify_all()

    def leave(self, conn):
        with self.changed:
            self.readers.discard(conn)
            if conn not in self.steering:
                return
            had = self.steering[0] is conn
            self.steering.remove(conn)
            if had:
                self.dirty = self.dirty or self.lens != LENS
                self.lens = LENS
                if self.steering:
                    heir = self.steering[0]
                    heir.told_busy = False
                    for kind, (value, extra, _) in sorted(heir.said.items(), key=lambda item: item[1][2]):
                        self.put(heir, kind, value, (heir.sent_lens, extra[1]) if extra else None)
                self.changed.notify_all()

    def render(self):
        while True:
            with self.changed:
                self.changed.wait_for(lambda: self.dirty)
                self.dirty = False
                camera, lens, poses, number, tag = self.camera, self.lens, dict(self.poses), self.number, self.tag
            color, depth = splats.drawn(camera, lens, poses)
            with self.changed:
                held = {conn.lease[1] for conn in self.readers if conn.lease} | {self.image["slot"] if self.image else -1}
                slot = min(set(range(SLOTS)) - held)
            at = slot * (COLOR + DEPTH)
            self.view[at : at + COLOR + DEPTH] = array.array("f", color).tobytes() + array.array("f", depth).tobytes()
            with self.changed:
                seq = self.image["seq"] + 1 if self.image else 0
                shown = {"position": camera[0], "rotation": camera[1], **lens}
                moved = [{"object": name, "position": p, "rotation": q, "scale": s} for name, (p, q, s) in poses.items()]
                self.image = {"slot": slot, "seq": seq, "camera": shown, "objects": moved, "number": number, "tag": tag, "at": time.monotonic()}
                for conn in list(self.readers):
                    self.lend(conn)

    def lend(self, conn):
        image = self.image
        if not image or not conn.open or conn.lease or conn.seq >= image["seq"]:
            return
        camera = dict(image["camera"])
        if image["tag"] is not None and image["number"] > conn.number:
            camera["tag"] = image["tag"]
        conn.lease, conn.seq, conn.number = (image["seq"], image["slot"]), image["seq"], image["number"]
        frame = {"type": "frame", "generation": GENERATION, "seq": image["seq"], "slot": image["slot"], "camera": camera}
        if LATER:
            frame["exposure"] = {"stops": self.exposure}
        conn.say({**frame, "objects": image["objects"], "time": 0, "renderedAt": image["at"]})


# ---- connections


class Connection:
    def __init__(self, world, sock, channel):
        self.world, self.sock, self.channel = world, sock, channel
        self.outgoing, self.waiting = queue.SimpleQueue(), 0
        self.greeted = self.modern = self.open = self.told_busy = False
        self.can, self.said, self.lens, self.sent_lens = frozenset(), {}, None, None
        self.lease, self.seq, self.number = None, -1, 0

    def say(self, message):
        payload = json.dumps(message).encode()
        self.waiting += len(payload)
        if self.waiting > 1 << 20:
            self.cut()
        self.outgoing.put(struct.pack("<I", len(payload)) + payload)

    def cut(self):
        try:
            self.sock.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass

    def write(self):
        while (packet := self.outgoing.get()) is not None:
            try:
                while packet:
                    sent = self.sock.send(packet)
                    packet, self.waiting = packet[sent:], self.waiting - sent
            except OSError:
                self.cut()
                return

    def limit(self, which, seconds):
        whole = int(seconds)
        self.sock.setsockopt(socket.SOL_SOCKET, which, struct.pack("ll", whole, int(1e6 * (seconds - whole))))

    def exactly(self, count, end=None):
        got = b""
        while len(got) < count:
            data = self.sock.recv(min(65536, count - len(got)))
            if not data or (end and time.monotonic() > end):
                raise ConnectionError
            got += data
        return got

    def packet(self):
        self.limit(socket.SO_RCVTIMEO, 0)
        first = self.exactly(1)
        end = time.monotonic() + 9.8
        self.limit(socket.SO_RCVTIMEO, 9.8)
        (length,) = struct.unpack("<I", first + self.exactly(3, end))
        if not 1 <= length <= 1 << 20:
            raise ConnectionError
        return self.exactly(length, end)

    def serve(self):
        self.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.limit(socket.SO_SNDTIMEO, 4.5)
        writer = threading.Thread(target=self.write, daemon=True)
        writer.start()
        take = self.on_ipc if self.channel == "ipc" else self.on_message
        try:
            while True:
                payload = self.packet()
                try:
                    message = parsed(payload)
                except (ValueError, RecursionError):
                    continue
                if message.get("type") != "hello":
                    take(message)
                elif not self.greeted and not self.greet(message):
                    break
        except OSError:
            pass
        self.world.leave(self)
        self.outgoing.put(None)
        writer.join()
        try:
            self.sock.shutdown(socket.SHUT_WR)
            self.limit(socket.SO_RCVTIMEO, 4.5)
            end = time.monotonic() + 4.5
            while self.greeted and time.monotonic() < end and self.sock.recv(65536):
                pass
        except OSError:
            pass
        self.sock.close()

    def greet(self, message):
        self.greeted = True
        try:
            versions, can = hello_in(message)
        except Wrong as wrong:
            self.say({"type": "error", "code": str(wrong), "message": "no hello"})
            return False
        version = next((each for each in versions if each in VERSIONS), None)
        if version is None:
            self.say({"type": "error", "code": "unsupported_version", "message": "", "supported": VERSIONS})
            return False
        self.modern = version != "1.0"
        mine = CAN[self.channel] | ({"exposure"} if version == "1.2" and self.channel == "msg" else set())
        self.can = mine & can if self.modern else frozenset()
        about = {"name": "cloud", "version": "0"}
        self.say({"type": "welcome", "version": version, "server": about, "capabilities": sorted(self.can)})
        if "frames" in self.can:
            with self.world.changed:
                full = len(self.world.readers) >= READERS
                if not full:
                    self.world.readers.add(self)
            if full:
                self.say({"type": "error", "code": "too_many_clients", "message": f"{READERS} read already"})
                return False
        if "host_shm" in self.can:
            self.say(self.world.init_packet())
        return True

    def on_ipc(self, message):
        kind = message.get("type")
        if not self.can or message.get("generation") != GENERATION or "frames" not in self.can:
            return
        with self.world.changed:
            if kind == "opened":
                self.open = True
            elif kind in ("closed", "open_failed"):
                self.open, self.lease = False, None
            elif kind == "release" and self.lease and message.get("seq") == self.lease[0]:
                self.lease = None
            self.world.lend(self)

    def on_message(self, message):
        kind, known = message.get("type"), {}
        try:
            if kind in ("camera_pose", "point_cloud_pose", "object_pose"):
                return self.on_pose(kind, message)
            if kind == "set_exposure" and "exposure" in self.can:
                self.world.exposure = real(message.get("stops"), -20.0, 20.0)
                return None
            if self.modern and "id" in message:
                known = {"id": whole(message["id"], 0, SAFE)}
            reply = self.reply(kind, message)
        except Wrong as wrong:
            asked = kind in ("get_viewport_size", "get_camera_pose", "get_scene", "set_viewport", "ping")
            if self.modern and (asked or str(wrong) != "unknown_type"):
                self.say({"type": "error", "code": str(wrong), "message": "that is not how it is done", **wrong.about, **known})
            return
        name, content = reply
        self.say({"type": name, **known, **content} if self.modern else content)

    def on_pose(self, kind, message):
        place, turn = pose_in(message)
        if kind == "camera_pose":
            lens = lens_in(message["intrinsics"], W, H) if "intrinsics" in self.can and "intrinsics" in message else None
            tag = text_of(message["tag"], 1, 64) if self.modern and "tag" in message else None
            self.sent_lens = lens or self.sent_lens
            about = None, (place, turn), (lens, tag)
        elif kind == "point_cloud_pose":
            about = "default", (place, turn, 1.0), None
        else:
            if "objects" not in self.can:
                raise Wrong("unsupported")
            name = text_of(message.get("object"), 1, 64)
            scale = real(message.get("scale", 1.0), 1e-6, 1e6)
            if name not in splats.OBJECTS:
                raise Wrong("unknown_object", "/object")
            about = name, (place, turn, scale), None
        with self.world.changed:
            mine = self.world.take(self, *about)
        if not mine and self.modern and not self.told_busy:
            self.told_busy = True
            raise Wrong("busy")

    def reply(self, kind, message):
        if kind == "get_viewport_size":
            return "viewport_size", {"viewport_size": [W, H] if self.world.image else [0, 0]}
        if kind == "get_camera_pose":
            place, turn = CAMERAS[whole(message.get("cam_idx"), -SAFE, SAFE) % len(CAMERAS)]
            lens = {"intrinsics": LENS} if "intrinsics" in self.can else {}
            return "camera", {"position": place, "rotation": turn, **lens}
        if kind == "get_scene" and "scene" in self.can:
            described = []
            for name, gaussians in splats.OBJECTS.items():
                low, high = splats.bounds(name)
                described.append({"id": name, "name": name.title(), "gaussians": len(gaussians), "bounds": {"min": low, "max": high}})
            return "scene", {"objects": described, "timeRange": None, "cameras": len(CAMERAS), "origin": [0, 0, 0]}
        raise Wrong("unsupported" if kind in ("get_scene", "set_viewport", "ping") else "unknown_type")


def listen(world, channel, port):
    listener = socket.create_server(("127.0.0.1", port))
    places = threading.BoundedSemaphore(MOST)

    def served(sock):
        try:
            Connection(world, sock, channel).serve()
        finally:
            places.release()

    while True:
        sock, _ = listener.accept()
        if not places.acquire(blocking=False):
            sock.close()
            continue
        threading.Thread(target=served, args=(sock,), daemon=True).start()


def main():
    world = World()
    threading.Thread(target=world.render, daemon=True).start()
    for channel, variable, usual in (("ipc", "SPLATBUS_IPC_PORT", 6001), ("msg", "SPLATBUS_MSG_PORT", 6000)):
        port = int(os.environ.get(variable, usual))
        threading.Thread(target=listen, args=(world, channel, port), daemon=True).start()
    try:
        signal.sigwait([signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
    finally:
        os.unlink(f"/dev/shm/{world.name}")
        os._exit(0)


signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
main()
