"""`python -m splatbus_viewer.adapter`: the example of an adapter (conformance/ADAPTER.md)."""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import sys
import threading
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any, TextIO

import numpy as np
from splatbus_client.session import Session, connect
from splatbus_wire.conventions import ENGINES, Engine
from splatbus_wire.poses import Pose
from splatbus_wire.semantics import semantics_object

from splatbus_viewer.display import composed
from splatbus_viewer.mirror import Mirror
from splatbus_viewer.questions import Questions

Json = dict[str, Any]
AXES = ("opencv", "unity", "unreal", "blender", "opengl", "opengl_camera")
REPLY_SECONDS = 8.0


class Adapter:
    """One method for each command: members in, members of the answer out."""

    # ruff: noqa: D102

    def __init__(self, axes: str) -> None:
        camera = "blender_camera" if axes == "blender" else axes
        thing = {"blender": "blender_object", "opengl_camera": "opencv"}.get(axes, axes)
        self._camera, self._object = ENGINES.get(camera), ENGINES.get(thing)

    def start(self) -> Json:
        self._session: Session = connect()
        self._mirror = Mirror(self._session)
        threading.Thread(target=self._watch, daemon=True).start()
        return {}

    def stop(self) -> Json:
        self._session.close()
        return {}

    def send_camera(self, position: list[float], rotation: list[float]) -> Json:
        self._session.send_camera(_to_wire(self._camera, position, rotation))
        return {}

    def send_object(self, position: list[float], rotation: list[float]) -> Json:
        self._session.send_object(_to_wire(self._object, position, rotation))
        return {}

    def ask(self, requests: list[Any]) -> Json:
        size, camera = self._session.ask_viewport_size, self._session.ask_camera_pose
        asked = [size() if it == "viewport_size" else camera(it["camera"]) for it in requests]
        return {"replies": [self._reply(future.result(REPLY_SECONDS)) for future in asked]}

    def subscribe(self, channels: list[str]) -> Json:
        self._session.subscribe(*channels)
        return {}

    def init_packet(self) -> Json:
        it = self._session.images
        return {"images": it and it._asdict() | {"semantics": semantics_object(it.semantics)}}

    def pixels(self, at: list[list[int]]) -> Json:
        if (image := self._mirror.newest) is None:
            return {"seq": None}
        color = None if image.color is None else [_numbers(image.color[y, x]) for x, y in at]
        depth = None if image.depth is None else [_number(image.depth[y, x]) for x, y in at]
        return {"seq": image.seq, "color": color, "depth": depth}

    def digest(self) -> Json:
        if (image := self._mirror.newest) is None:
            return {"seq": None}
        return {"seq": image.seq, "color": _sha256(image.color), "depth": _sha256(image.depth)}

    def frame(self) -> Json:
        image = self._mirror.newest
        if image is None or image.camera is None:
            return {"seq": None}
        camera = {**image.camera._asdict(), **self._told(self._camera, image.camera.pose)}
        objects = [{**it._asdict(), **self._told(self._object, it.pose)} for it in image.objects]
        return {"seq": image.seq, "camera": camera, "time": image.time, "objects": objects}

    def composite(self, color: list[float], depth: float | str, at: list[list[int]]) -> Json:
        image = self._mirror.newest
        if image is None or image.color is None or image.depth is None:
            return {"seq": None}
        mesh = np.broadcast_to(np.array(color, np.float32), (*image.depth.shape, 3))
        mesh_depth = np.full_like(image.depth, float(depth))
        shown = composed(image.color, image.depth, image.camera, image.semantics, mesh, mesh_depth)
        return {"seq": image.seq, "color": [_numbers(shown[y, x]) for x, y in at]}

    def _reply(self, reply: Any) -> Json:
        if not isinstance(reply, Pose):
            return {"width": reply[0], "height": reply[1]}
        return self._told(self._camera, reply)

    def _told(self, engine: Engine | None, pose: Pose) -> Json:
        return (engine.from_wire(pose) if engine else pose)._asdict()

    def _watch(self) -> None:
        questions = Questions(self._session)
        try:
            while True:
                questions.follow()
                self._mirror.read(timeout=0.05)
        except RuntimeError:
            return  # the session is closed


def _to_wire(engine: Engine | None, position: Any, rotation: Any) -> Pose:
    pose = Pose(tuple(position), tuple(rotation))
    return engine.to_wire(pose) if engine else pose


def _sha256(image: Any) -> str | None:
    return None if image is None else hashlib.sha256(image.astype("<f4").tobytes()).hexdigest()


def _numbers(values: Any) -> list[float | str]:
    return [_number(value) for value in values]


def _number(value: float) -> float | str:
    return float(value) if math.isfinite(value) else str(float(value))


def serve(adapter: Adapter, out: TextIO, client: Json, **engine: Any) -> None:
    """Answer one line after the other, until `stop` or the end of the input.

    Args:
        adapter: whose methods the commands are.
        out: where answers go.
        client: name and version of who is judged.
        engine: axes, units and precision of its poses.
    """
    can = [name for name in dir(adapter) if not name.startswith("_")]
    print(
        json.dumps({"adapter": "1", "client": client, **engine, "can": can}), file=out, flush=True
    )
    for line in sys.stdin:
        members = json.loads(line)
        number, name = members.pop("id"), members.pop("command")
        try:
            if name not in can:
                raise ValueError(f"there is no command {name!r}")
            answer = getattr(adapter, name)(**members)
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps({"id": number, **answer}, allow_nan=False), file=out, flush=True)
        if name == "stop":
            break


def main(arguments: Sequence[str] | None = None) -> None:
    """Answer for the client of this package, in the axes that are asked for."""
    parser = argparse.ArgumentParser(prog="python -m splatbus_viewer.adapter")
    parser.add_argument("--axes", choices=AXES, default="opencv", help="whose axes poses are in")
    axes = parser.parse_args(arguments).axes
    client = {"name": "splatbus-client", "version": version("splatbus-protocol")}
    metre = 100 if axes == "unreal" else 1
    serve(Adapter(axes), sys.stdout, client, axes=axes, unitsPerMetre=metre, precision="double")


if __name__ == "__main__":
    main()
