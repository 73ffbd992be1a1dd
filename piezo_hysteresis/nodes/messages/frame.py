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

"""`frame_name`: the name of the frame in which an axis measures, as REP 105 and tf2 require it."""

from __future__ import annotations

import re

from ...errors import ParameterError, printable

_FRAME = re.compile(r"[A-Za-z0-9_]+(/[A-Za-z0-9_]+)*")
"""Words of letters, digits and underscores with slashes in between; tf2 refuses a leading slash."""

_WITHOUT_NAMESPACE = "stage"
"""Frame of an axis in the root namespace."""


def frame_name(given: str, namespace: str) -> str:
    """Name for the headers of an axis.

    Parameters
    ----------
    given : str
        Name given by the user; empty for the namespace of the axis.
    namespace : str
        Of the driver, e.g. ``/stage_x``.

    Raises
    ------
    ParameterError
        If the given name is not allowed for a frame.

    Examples
    --------
    >>> frame_name("", "/lab/stage_x"), frame_name("", "/"), frame_name("mirror", "/lab")
    ('lab/stage_x', 'stage', 'mirror')
    """
    name = given or namespace.strip("/") or _WITHOUT_NAMESPACE
    if not _FRAME.fullmatch(name):
        raise ParameterError(
            f"frame_id: got '{printable(name)}', expected letters, digits and '_', with '/' in between only"
        )
    return name
