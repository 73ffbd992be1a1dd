"""Matrix products on one core, because for small matrices the threads of BLAS mostly wait for each other."""

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
    """Decorator: BLAS uses one thread while the function runs, and as many as before when it has ended.

    On a busy machine the waiting of the threads takes several times longer than the products.

    Parameters
    ----------
    function : callable
        The function to run, for example a fit.
    """

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
