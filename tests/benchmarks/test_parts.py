"""Variants that are to compute the same thing do, so that only time and rounding differ."""

import numpy as np
import pytest
from splatbus_wire.compositing import over_straight

from benchmarks.accuracy import chain, compositing, depth, parsing, printing, rotation, search, view
from benchmarks.accuracy.images import HEIGHT, WIDTH


def of(variants):
    return pytest.mark.parametrize("variant", variants, ids=lambda variant: variant.name)


Q = (0.1, -0.2, 0.3, 0.9273618495495703)


@of(rotation.VARIANTS)
def test_rotation(variant):
    got = search.floats(variant.compute(Q))
    assert got == pytest.approx(rotation.rotation_matrix(Q), abs=1e-6)


@of(view.VARIANTS)
def test_view(variant):
    pose = view.pose_of((1.0, -2.0, 5.0, *Q))
    assert variant.compute(pose) == pytest.approx(view.default(pose), abs=1e-5)


@of(chain.VARIANTS)
def test_chain(variant):
    poses = chain.poses_of((1.0, -2.0, 5.0, *Q, 0.5, 0.25, -1.0, 0.0, 0.6, 0.0, 0.8))
    assert variant.compute(poses) == pytest.approx(chain.default(poses), abs=1e-5)


@of([each for each in depth.VARIANTS if not each.role and not each.unlike])
def test_depth(variant):
    inputs = depth.pool()
    with np.errstate(all="ignore"):
        expected = depth.computed(depth.published, inputs)
        got = depth.computed(variant.compute, inputs)
    assert np.isinf(got).tolist() == np.isinf(expected).tolist()
    if "1/d" not in variant.name:
        assert np.array_equal(got, expected)


@of([each for each in compositing.VARIANTS if each.role != "deployed"])
def test_compositing(variant):
    source = np.random.default_rng(2)
    C = source.random((9, 7, 4), np.float32)
    B = source.random((9, 7, 3), np.float32)
    z, far = source.random((2, 9, 7), np.float32)
    z[0], z[1], C[2, ..., 3] = np.inf, np.nan, 0.0
    got = variant.compute(C, z, B, far)
    assert got == pytest.approx(over_straight(C, z, B, far), abs=1e-6)
    if not variant.unlike:
        C[0, ..., :3] = np.nan
        assert np.array_equal(variant.compute(C, z, B, far)[0], B[0])


@of(printing.VARIANTS)
def test_printing(variant):
    assert printing.read_back(variant.compute, 0.125) == 0.125


@of(printing.VARIANTS)
def test_printing_refuses_what_is_not_finite(variant):
    if not variant.unlike.startswith("sends"):
        with pytest.raises(ValueError, match="finite"):
            variant.compute((float("nan"),) * 7)


@of(parsing.VARIANTS)
def test_parsing(variant):
    texts = ("1.5", "-2e1", "0.25", "0", "0.6", "-0.0", "0.8")
    assert variant.compute(parsing.payload_of(texts)) == pytest.approx(
        [1.5, -20.0, 0.25, 0.0, 0.6, 0.0, 0.8]
    )


def test_images_are_of_the_size_that_the_titles_say():
    assert (WIDTH, HEIGHT) == (1920, 1080)
