"""What the harness paints is never taken for something else."""

import hashlib

import numpy as np
from splatbus_conformance.images.painted import coordinates, sha256, spoilt


def test_every_pixel_says_where_it_lies_and_survives_nothing_else():
    image = coordinates(3, 7, 5)
    assert len({tuple(pixel) for pixel in image.color.reshape(-1, 4).tolist()}) == 35
    for other in (
        image._replace(color=image.color[::-1]),
        image._replace(color=image.color[:, ::-1]),
        image._replace(color=np.floor(image.color * 255) / np.float32(255)),
        coordinates(4, 7, 5),
        spoilt(7, 5),
    ):
        assert other.digests()[0] != image.digests()[0]


def test_a_digest_is_that_of_the_page():
    image = np.array([[[0.0, 0.5, 1.0, 1.0]], [[0.25, 0.0, 0.0, 0.0]]], np.float32)
    data = image.astype("<f4").tobytes()
    assert sha256(image) == hashlib.sha256(data).hexdigest()
    assert sha256(image[::-1]) == hashlib.sha256(data[16:] + data[:16]).hexdigest()
