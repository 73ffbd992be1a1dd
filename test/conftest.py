"""Two processes share the tests; one of them has all that start nodes, and these the other core."""

import pytest


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        nodes = item.get_closest_marker("nodes") is not None
        item.add_marker(pytest.mark.xdist_group("nodes" if nodes else item.path.stem))
