"""What the tests on a GPU share."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session")
def device() -> object:
    from splatbus_server.cuda.driver import Device

    return Device(0)


@pytest.fixture(scope="session")
def compiler(device: object) -> object:
    from splatbus_server.cuda.kernels import Compiler

    return Compiler(device.capability)


@pytest.fixture
def current(device: object) -> Iterator[None]:
    with device.current():
        yield


@pytest.fixture
def torch() -> object:
    if importlib.util.find_spec("torch") is None:
        pytest.skip("PyTorch is not installed")
    import torch

    return torch
