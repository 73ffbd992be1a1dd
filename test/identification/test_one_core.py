# Copyright 2026 piezo_hysteresis maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""While we fit, BLAS has one thread; before and after, as many as its user gave it."""

from __future__ import annotations

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.identification.one_core import on_one_core


def _threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_blas_uses_one_thread_inside_and_all_afterwards() -> None:
    with threadpool_limits(limits=2, user_api="blas"):
        assert on_one_core(_threads)() == {1}
        assert _threads() == {2}


def test_blas_threads_are_restored_when_a_fit_fails() -> None:
    @on_one_core
    def fails() -> None:
        raise IdentificationError("nothing moves")

    with threadpool_limits(limits=2, user_api="blas"):
        with pytest.raises(IdentificationError, match="nothing moves"):
            fails()
        assert _threads() == {2}


def test_a_function_on_one_core_keeps_its_name_and_its_arguments() -> None:
    @on_one_core
    def product(a: int, *, b: int = 2) -> int:
        """The product."""
        return a * b

    assert (product(3), product(3, b=4), product.__name__, product.__doc__) == (6, 12, "product", "The product.")
