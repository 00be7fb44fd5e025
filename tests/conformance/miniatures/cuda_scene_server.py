"""The small server of 1.0 in CUDA memory, with the scene of SCENE.md in place of its wall."""

import cuda_server
import numpy as np
from cuda_server import ORIGIN, Server, run
from splatbus_renderer.raycast import Raycaster
from splatbus_renderer.scene import Camera, ObjectPose, default_scene
from splatbus_wire.rotations import rotation_matrix

cuda_server.WIDTH, cuda_server.HEIGHT = WIDTH, HEIGHT = 64, 48
cuda_server.COLOR, cuda_server.DEPTH = 16 * WIDTH * HEIGHT, 4 * WIDTH * HEIGHT
LENS = 44.0, 40.0, 30.25, 25.5
RAYCASTER = Raycaster(WIDTH, HEIGHT)


def turned(rotation):
    return np.array(rotation_matrix([float(rotation[name]) for name in "xyzw"])).reshape(3, 3)


def viewed(turn, place, norm):
    """The camera as the renderer has it; `norm` is that of the quaternion."""
    return turn, place


def draw(number, poses):
    """Colour and depth, the bottom row first."""
    scene, camera = (poses.get(f"{what}_pose", ORIGIN) for what in ("point_cloud", "camera"))
    place = np.array([camera["position"][name] for name in "xyz"])
    norm = np.linalg.norm([camera["rotation"][name] for name in "xyzw"])
    turn, place = viewed(turned(camera["rotation"]), place, norm)
    pose = ObjectPose(
        tuple(scene["position"][name] for name in "xyz"),
        tuple(map(tuple, turned(scene["rotation"]).tolist())),
    )
    matrix = tuple(map(tuple, turn.tolist()))
    seen = Camera(WIDTH, HEIGHT, *LENS, tuple(place.tolist()), matrix)
    shown = default_scene()
    image = RAYCASTER.render(type(shown)(shown.spheres, shown.floor, shown.light, pose), seen)
    return image.color[::-1].tobytes(), image.depth[::-1].tobytes()


cuda_server.draw = draw

if __name__ == "__main__":
    run(Server())
