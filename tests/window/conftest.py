from collections.abc import Iterator

import pytest

from tests.window.stage import demo, display


@pytest.fixture(scope="session")
def screen() -> Iterator[None]:
    with display():
        yield


@pytest.fixture
def server(screen: None) -> Iterator[object]:
    with demo() as where:
        yield where
