"""The connection that Blender's interface asks, without Blender, beside our server."""

import itertools
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import splatbus_client
import splatbus_server
from splatbus_blender.core import wanted
from splatbus_blender.core.connection import Connection
from splatbus_blender.core.lens import for_images
from splatbus_blender.core.online import is_this_computer
from splatbus_blender.core.poses import Placed
from splatbus_blender.core.wanted import Wanted
from splatbus_client.reading import ImagesOpen
from splatbus_server import SceneObject, Semantics, View
from splatbus_wire.messages import FrameCamera, Hello, Intrinsics, Placement, Program, encode
from splatbus_wire.poses import IDENTITY, Pose

from tests.engines.stage import HEIGHT, WIDTH, planes, serving
from tests.waiting import eventually

UPRIGHT = (0.5**0.5, 0.0, 0.0, 0.5**0.5)
"""A camera that looks along Blender's y, which is the wire's z."""
LENS = Intrinsics(50.0, 50.0, 32.0, 24.0, WIDTH, HEIGHT, 0.5, 200.0)


def looking_from(x: float, **more: Any) -> Wanted:
    return Wanted(Placed((x, 0.0, 0.0), UPRIGHT), LENS)._replace(**more)


def render(view: View) -> Any:
    return planes(view.poses.camera, view.width, view.height)


@contextmanager
def connected(where: dict[str, str]) -> Iterator[Connection]:
    ports = (int(where[f"SPLATBUS_{name}_PORT"]) for name in ("IPC", "MSG"))
    connection = Connection("127.0.0.1", *ports)
    try:
        yield connection
    finally:
        connection.close()


def ours() -> list[threading.Thread]:
    return [each for each in threading.enumerate() if each.name.startswith("splatbus-blender")]


def test_an_image_of_what_is_wanted_comes() -> None:
    objects = {"chair": Placed((1.0, 5.0, 2.0), (0.0, 0.0, 0.0, 1.0), (2.0, 2.0, 2.0))}
    scene: dict[str, Any] = {
        "objects": [SceneObject(each, "", 0) for each in ("default", "chair")],
        "time_range": (0.0, 10.0),
    }
    seen: list[View] = []

    def noted(view: View) -> Any:
        seen.append(view)
        return render(view)

    with serving(noted, **scene) as where, connected(where) as connection:
        for x in (1.5, -2.5):
            image = connection.image_of(looking_from(x, objects=objects, seconds=x + 3), 20)
            assert image.objects == (Placement("chair", Pose((1, -2, 5), (0, 0, 0, 1)), 2.0),)
            assert seen[-1].poses.time == x + 3
            assert image.camera
            assert image.camera.pose.position == (x, 0, 0)
            assert image.camera.intrinsics == LENS
            color, depth = planes(image.camera.pose)
            np.testing.assert_array_equal(image.color, color)
            np.testing.assert_array_equal(image.depth, depth)
        before = len(seen)
        for _ in range(50):
            connection.tell(looking_from(x, objects=objects, seconds=x + 3))
        connection.image_of(looking_from(2), 20)
        assert len(seen) == before + 1, "it is told what is new alone"


def test_a_view_of_another_size_gets_images_of_it() -> None:
    with serving(render) as where, connected(where) as connection:
        image = connection.image_of(looking_from(1, size=(40, 30)), 20)
        assert image.camera
        assert (image.camera.width, image.camera.height) == (40, 30)
        assert image.camera.fx == LENS.fx * 40 / WIDTH


def test_depth_is_read_where_somebody_looks_at_it() -> None:
    """Colour alone is told and read as soon as no depth is shown, and a render has both again."""

    def without_depth() -> bool:
        connection.tell(looking_from(2, depth=False))
        shown = connection.image
        return shown is not None and shown.depth is None and shown.color is not None

    with serving(render) as where, connected(where) as connection:
        for x in (1, 2, 3):  # the second stands where colour alone was seen from
            image = connection.image_of(looking_from(x), 20)
            assert image.color is not None
            assert image.depth is not None
            if x == 1:
                assert eventually(without_depth)


def test_a_server_that_goes_takes_its_image_and_brings_it_back() -> None:
    """In the shape of the view again, though its own is another, and be it one without time."""
    with splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=0) as bus:
        ports = bus.address.ipc_port, bus.address.message_port
    view = looking_from(3, size=(40, 40), seconds=1.0)

    def comes(bus: splatbus_server.Bus, wanted: Wanted = view) -> bool:
        connection.tell(wanted)
        if (asked := bus.next_view(0.1)) is not None:
            bus.publish(asked, *render(asked))
        image = connection.image
        camera = None if image is None else image.camera
        return camera is not None and (camera.pose.position, camera.fx) == ((3, 0, 0), lens.fx)

    moved = (looking_from(x, size=(40, 40), seconds=1.0) for x in itertools.count(4))

    def settles(bus: splatbus_server.Bus) -> bool:
        """A complaint may come last of all: it goes with the next pose that is taken."""
        comes(bus, next(moved))
        return not connection.problems

    connection = Connection("127.0.0.1", *ports)
    try:
        with pytest.raises(TimeoutError, match=r"images: .*refused"):
            connection.image_of(looking_from(1), 0.5)
        lens = for_images(LENS, 40, 40)
        for times in ((0.0, 10.0), None):
            assert connection.image is None
            connection.tell(view)
            with splatbus_server.serve(
                WIDTH, HEIGHT, ipc_port=ports[0], message_port=ports[1], time_range=times
            ) as bus:
                assert eventually(lambda bus=bus: comes(bus))
                assert eventually(lambda bus=bus: settles(bus)), connection.problems
            assert eventually(lambda: connection.image is None)
            assert connection.newest is not None
    finally:
        connection.close()


def test_what_is_wrong_is_told_no_longer_than_it_is() -> None:
    """Once who had control has gone, and a client that could not follow another size."""
    with serving(render) as where, connected(where) as connection:

        def seen() -> tuple[int, float] | None:
            camera = connection.image and connection.image.camera
            return camera and (camera.width, camera.pose.position[0])

        def comes() -> bool:
            connection.tell(looking_from(1, size=(40, 30)))
            return seen() == (40, 1)

        assert eventually(lambda: connection.image is not None)
        place = "127.0.0.1", int(where["SPLATBUS_IPC_PORT"])
        with (
            splatbus_client.connect(*place, int(where["SPLATBUS_MSG_PORT"])) as other,
            socket.create_connection(place, 20) as old,
        ):
            old.sendall(encode(Hello(("1.1",), Program("old", "1"), ("host_shm", "frames"))))
            told = b""
            while b"generation" not in told:
                told += old.recv(4096)
            other.send_camera(Pose((9, 0, 0), (0, 0, 0, 1)), tag="theirs")
            other.next_frame(20).release()
            assert eventually(lambda: seen() == (WIDTH, 9))
            for id in ("POS-11", "CTL-1", "VPT-3"):
                assert eventually(lambda id=id: not comes() and id in str(connection.problems))
        assert eventually(comes)
        assert eventually(lambda: not connection.problems), connection.problems


def test_telling_never_waits_for_a_render_which_ends_when_it_is_cancelled() -> None:
    connection, cancelled, asked = Connection("127.0.0.1", 1, 1), threading.Event(), []

    def wait(cancelled: Callable[[], bool]) -> None:
        with pytest.raises(TimeoutError):
            connection.image_of(looking_from(1), 3600, cancelled)

    def cancels() -> bool:
        asked.append(True)
        return cancelled.is_set()

    for ends in (cancelled.set, connection.close):
        waiting = threading.Thread(target=wait, args=(cancels,))
        waiting.start()
        assert eventually(lambda: bool(asked))
        connection.tell(looking_from(2))
        ends()
        waiting.join(20)
        assert not waiting.is_alive()
        cancelled.clear()
    assert eventually(lambda: not ours())


def test_a_host_that_is_not_there_is_a_problem() -> None:
    connection = Connection("no-such-host.invalid")
    assert eventually(lambda: bool(connection.problems))
    assert connection.session is None
    assert connection.status is None
    connection.tell(looking_from(1))
    connection.close()
    assert eventually(lambda: not ours())


def test_a_server_elsewhere_is_one_that_is_not_here_for_sure() -> None:
    assert all(map(is_this_computer, ("localhost", "127.0.0.1", "127.3.2.1", "::1")))
    assert not any(map(is_this_computer, ("192.168.0.2", "localhost.example", "8.8.8.8", "")))


IMAGES = ImagesOpen(1, WIDTH, HEIGHT, Semantics(unit_metres=0.5))


def test_what_is_said_is_in_units_of_the_scene() -> None:
    objects = {"chair": Placed((2.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 2.0))}
    said = wanted.said(looking_from(1, objects=objects), IMAGES)
    assert said.camera
    assert said.camera.position == (2, 0, 0)
    assert said.lens == LENS._replace(near=1.0, far=400.0)
    assert not said.objects
    assert "'chair'" in said.problems[0]
    later = wanted.said(looking_from(1), IMAGES, last=False)
    assert (later.camera, later.lens) == (said.camera, None)


def test_an_image_shows_what_was_said_as_far_as_the_server_can() -> None:
    said = wanted.said(looking_from(1, objects={"a": Placed((0, 1, 0), (0, 0, 0, 1))}), IMAGES)
    assert said.camera
    assert said.lens
    camera = FrameCamera(said.camera, *said.lens)
    moved = Placement("a", said.objects["a"][0])
    every = ("intrinsics", "objects")
    assert wanted.shows(camera, [moved], said, every)
    assert wanted.shows(camera, [], said, ["intrinsics"])
    assert not wanted.shows(camera, [], said, every)
    assert not wanted.shows(camera._replace(fx=51.0), [moved], said, every)
    assert wanted.shows(camera._replace(fx=51.0), [moved], said, ["objects"])
    assert not wanted.shows(camera._replace(pose=IDENTITY), [moved], said, every)
    x, y, z, w = camera.pose.rotation
    negative = Pose(camera.pose.position, (-x, -y, -z, -w))
    assert wanted.shows(camera._replace(pose=negative), [moved], said, every)
