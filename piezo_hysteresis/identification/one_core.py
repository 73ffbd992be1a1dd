"""Matrix products on one core: for small matrices, the threads of BLAS mostly wait for one another."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import scipy.linalg  # noqa: F401 - brings a BLAS of its own beside that of numpy, which must be there to be limited
from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()


def on_one_core(function: Callable[P, R]) -> Callable[P, R]:
    """The function, with one thread for BLAS while it runs; as many as before when it ends.

    On a machine with other work to do, waiting threads take several times the time that the products take.

    Parameters
    ----------
    function : callable
        One that fits.
    """

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
