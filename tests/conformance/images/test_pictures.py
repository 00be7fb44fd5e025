"""Pictures of an image that was judged, for people."""

import base64
import io
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.known_scene import render
from splatbus_conformance.images.pictures import NO_NUMBER, Picture, pictures_of
from splatbus_conformance.images.pinhole import Camera, Rigid

from tests.conformance.harness import run

CAMERA = Camera(Rigid(), 50.0, 50.0, 32.0, 24.0, 64, 48, 0.01, 100.0)
MUTANT = f'"{sys.executable}" -m tests.zoo.mutants '
SERVER = MUTANT + "server-stores-blue-first --quiet --size 64x48"
CLIENT = MUTANT + "forgets-that-rows-are-bottom-up --axes opencv"
BLUE, ROWS = (..., slice(None, None, -1)), (slice(None, None, -1),)
"""How what came is to be read to be what belongs there."""


def pixels(picture: Picture) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(picture.png))))


def test_what_came_what_belongs_there_and_where_they_differ() -> None:
    exact = render(CAMERA)
    color, depth = exact.color.astype(np.float32), exact.depth.astype(np.float32)
    color[20:30, 30:40, 0] += 0.5
    depth[5:10] *= 2
    color[0, 0] = np.nan
    came, wanted, apart = pictures_of(CapturedFrame({}, CAMERA, color, depth, {}), exact)
    assert pixels(came).shape == (240, 320, 3), "five times as large"
    assert tuple(pixels(came)[0, 0]) == NO_NUMBER
    same = (pixels(came) == pixels(wanted)).all(axis=-1)
    assert not same[100:150, 150:200].any()
    assert same[160:].all()
    red, _, blue = np.moveaxis(pixels(apart)[2::5, 2::5], -1, 0)
    certain = exact.certain
    assert (red[20:30, 30:40][certain[20:30, 30:40]] > 100).all()
    assert (red[32:][certain[32:]] < 100).all()
    assert (blue[5:10][certain[5:10] & np.isfinite(exact.depth[5:10])] > 100).all()


def test_a_scene_that_is_not_known_shows_what_came() -> None:
    exact = render(CAMERA)
    large = np.zeros((960, 1280, 4), np.float32)
    frame = CapturedFrame({}, CAMERA, large, large[..., 0], {})
    assert [it.title for it in pictures_of(frame, None)] == ["what came"]
    assert pixels(pictures_of(frame, None)[0]).shape == (480, 640, 3)
    assert len(pictures_of(frame._replace(color=exact.color, depth=exact.depth), exact)) == 3


@pytest.mark.parametrize(
    ("broken", "misread"),
    [
        (("server", "--launch", SERVER, "--select", "check_every_pixel_is_of_the_camera"), BLUE),
        (("client", "--adapter", CLIENT, "--select", "check_shows_rows_from_the_bottom_up"), ROWS),
    ],
    ids=("server", "client"),
)
def test_a_failure_of_an_image_shows_it_on_the_page(
    broken: tuple[str, ...], misread: tuple[slice, ...], tmp_path: Path
) -> None:
    report, page = tmp_path / "report.json", tmp_path / "page.html"
    words = ("--shrink", "0", "--parallel", "1", "--scripts", str(tmp_path))
    status, told = run(*broken, *words, "--json", str(report), "--html", str(page))
    assert status == 1, told
    requirements = json.loads(report.read_text("utf-8"))["requirements"]
    (found,) = [it for each in requirements for it in each["results"] if it["verdict"] == "fail"]
    came, wanted, _ = (pixels(Picture(**each)) for each in found["pictures"])
    assert (came[misread] == wanted).all(axis=-1).mean() > 0.95
    assert (came != wanted).any()
    text = page.read_text("utf-8")
    assert all(f"data:image/png;base64,{each['png']}" in text for each in found["pictures"])
