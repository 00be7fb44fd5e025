"""A server of SplatBus 1.0 whose renderer fails: it listens for a moment, and ends."""

import os
import socket
import time

HOST = os.environ.get("SPLATBUS_HOST", "127.0.0.1")
PORTS = [os.environ.get(name) for name in ("SPLATBUS_IPC_PORT", "SPLATBUS_MSG_PORT")]


def load_scene():
    raise FileNotFoundError("point_cloud/iteration_30000/point_cloud.ply")


listeners = [socket.create_server((HOST, int(port))) for port in PORTS if port]
time.sleep(0.3)
load_scene()
