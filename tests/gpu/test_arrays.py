"""Arrays of the libraries that renderers are written with, read where they lie."""

from __future__ import annotations

import importlib

import numpy as np
import pytest

from tests.gpu import require_gpu

require_gpu()

from splatbus_server.cuda.driver import api, call  # noqa: E402

from tests.gpu.images import BOTH, memory, slot  # noqa: E402

SIZE = (64, 48)
IMAGE = np.random.default_rng(3).random((48, 64, 4), np.float32)
IMAGE[..., 3] = 1.0
DEPTH = 1 + IMAGE[..., 0]


def library(name: str):
    if importlib.util.find_spec(name) is None:
        pytest.skip(f"{name} is not installed")
    return importlib.import_module(name)


def of_torch():
    torch = library("torch")
    return lambda array: torch.from_numpy(array).cuda().requires_grad_()


def of_cupy():
    return library("cupy").asarray


def of_jax():
    library("jax")
    jax = importlib.import_module("jax.numpy")
    return jax.asarray


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("make", [of_torch, of_cupy, of_jax])
def test_arrays_of_a_library_are_published(make, device, compiler):
    convert = make()
    color, depth = convert(IMAGE), convert(DEPTH)
    with device.current():
        ours = memory(SIZE, device, compiler)
        ours.writer(color, depth, None, "linear", None)(0, BOTH)
        found = slot(ours, 0)
        np.testing.assert_array_equal(found[0], IMAGE)
        np.testing.assert_array_equal(found[1], DEPTH)
        ours.close()


def test_parts_of_a_tensor_are_read_without_a_copy(torch, device, compiler):
    everything = torch.from_numpy(np.concatenate((IMAGE, DEPTH[..., None]), -1)).cuda()
    with device.current():
        ours = memory(SIZE, device, compiler)
        ours.writer(everything[..., :3], everything[..., 4:], None, "linear", None)(0, BOTH)
        found = slot(ours, 0)
        np.testing.assert_array_equal(found[0][..., :3], IMAGE[..., :3])
        np.testing.assert_array_equal(found[1], DEPTH)
        half = everything.half().permute(2, 0, 1)
        ours.writer(half[:4], half[4:], None, "linear", None)(1, BOTH)
        found = slot(ours, 1)
        np.testing.assert_array_equal(found[0], IMAGE.astype("f2").astype("f4"))
        ours.close()


def test_the_current_stream_of_a_tensor_is_worked_on(torch, device, compiler):
    """A tensor that is freed and made anew in a loop, behind slow work on a stream of its own."""
    stream = torch.cuda.Stream()
    with device.current():
        ours = memory((1920, 1080), device, compiler)
    with torch.cuda.stream(stream):
        depth = torch.ones((1080, 1920), device="cuda")
        for value in range(40):
            torch.cuda._sleep(200_000)
            color = torch.full((1080, 1920, 4), value / 64, device="cuda")
            ours.writer(color, depth, None, "linear", None)(value % 3, BOTH)
            del color
    with device.current():
        for value in (37, 38, 39):
            assert (slot(ours, value % 3)[0] == value / 64).all()
        ours.close()


@pytest.mark.filterwarnings("default")
def test_memory_of_a_library_is_kept_until_it_has_been_read(device, compiler):
    convert = of_jax()
    with device.current():
        ours = memory(SIZE, device, compiler)
        for slot_ in (0, 1, 2, 0, 1, 2):
            ours.writer(convert(IMAGE), convert(DEPTH), None, "linear", None)(slot_, BOTH)
        assert ours._in_use
        call(api.cuCtxSynchronize)
        ours.writer(convert(IMAGE), None, None, "linear", None)(0, frozenset({"color"}))
        assert set(ours._in_use) == {0}
        ours.close()


def test_tensors_on_the_host_and_of_other_numbers_are_refused(torch, device, compiler):
    with device.current():
        ours = memory(SIZE, device, compiler)
        for tensor, message in (
            (torch.ones((48, 64, 4)), "memory of the host"),
            (torch.ones((48, 64, 4), device="cuda").bfloat16(), "float32 or float16"),
        ):
            with pytest.raises(ValueError, match=message):
                ours.writer(tensor, None, None, "linear", None)
        ours.close()
