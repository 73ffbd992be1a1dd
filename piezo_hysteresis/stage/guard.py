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

"""`guarded`: if its device fails, a stage goes to its safe voltage and reports whether this succeeded."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..errors import DeviceError, StageError


@contextmanager
def guarded(retreat: Callable[[], None], reached: Callable[[], str], unknown: Callable[[], str]) -> Iterator[None]:
    """Bring the stage to its safe voltage when the device fails within the block.

    Parameters
    ----------
    retreat : callable
        Goes to the safe voltage; raises DeviceError if that fails, too.
    reached, unknown : callable
        Return the end of the message: where the stage is after the retreat, or what is known if the retreat failed.

    Raises
    ------
    StageError
        In place of the DeviceError; the message says where the stage is.
    """
    try:
        yield
    except DeviceError as error:
        try:
            retreat()
            end = reached()
        except DeviceError:
            end = unknown()
        raise StageError(f"{error}; {end}") from None
