import pytest

from tisoft import runtime


@pytest.fixture(scope="session", autouse=True)
def taichi_started():
    runtime.start()
