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

"""`in_home`: a path that may begin with the home folder of a user."""

from __future__ import annotations

import os
from pathlib import Path

from .errors import ParameterError


def in_home(path: str | os.PathLike[str]) -> Path:
    """The path with ``~`` or ``~user`` at its beginning replaced by the home folder.

    Raises
    ------
    ParameterError
        If there is no such user.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError:
        raise ParameterError(f"{path}: there is no home folder of that user, expected another path") from None
