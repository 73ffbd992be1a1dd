"""Entry points of the node executables: nothing slow is imported before an interrupt is handled."""

from __future__ import annotations

import signal
from importlib import import_module


def driver_node() -> int:
    """Run a driver."""
    return _run("driver.driver_node")


def model_node() -> int:
    """Run a model node."""
    return _run("model.model_node")


def identification_node() -> int:
    """Run an identification node."""
    return _run("identification.identification_node")


def compensation_node() -> int:
    """Run a compensation node."""
    return _run("compensation.compensation_node")


def _run(module: str) -> int:
    try:
        return int(import_module(f".{module}", __package__).main())
    except (KeyboardInterrupt, ImportError) as error:
        if _was_interrupted(error):
            return 128 + signal.SIGINT
        raise


def _was_interrupted(error: BaseException | None) -> bool:
    """Libraries turn an interrupt while they are imported into an ImportError of their own."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False
