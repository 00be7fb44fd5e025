"""A scene that is another one each second, on a GPU: `python -m tests.gpu.splats_server`.

It prints its ports, IPC first.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping

import splatbus_server
from splatbus_splats.drawing import gpu
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import made
from splatbus_splats.serving import SEMANTICS, render_until
from splatbus_wire.poses import Pose

SIZE = (640, 480)
SCENES = (made(20_000, seed=1), made(30_000, seed=2))
FAR_AWAY = Pose((0.3, -0.2, -0.5), (0.0, 0.1, 0.05, 0.99))


class Sequence:
    """The scene, each of a second."""

    time_range = (0.0, len(SCENES) - 1.0)
    loop = float(len(SCENES))

    def moment(self, time: float | None) -> int:
        return int(time or 0.0)

    def lasts(self, playing: float) -> float:
        return 1.0 - playing % 1.0

    def at(self, time: float | None) -> Mapping[str, Gaussians]:
        return {"default": SCENES[self.moment(time)]}


def main() -> None:
    with splatbus_server.serve(
        *SIZE,
        memory="cuda_ipc",
        semantics=SEMANTICS,
        time_range=Sequence.time_range,
        ipc_port=0,
        message_port=0,
    ) as bus:
        print(*bus.address[1:], flush=True)
        render_until(threading.Event(), bus, Sequence(), gpu.Renderer())


if __name__ == "__main__":
    main()
