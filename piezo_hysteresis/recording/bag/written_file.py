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

"""`check_in_place`: checks that a file is still at the place where its writing began."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO


def check_in_place(stream: BinaryIO, path: Path) -> None:
    """Check that the file still exists, because writing to a deleted or moved file raises no error.

    Parameters
    ----------
    stream : binary file
        The file that is written.
    path : Path
        Path at which it was opened.

    Raises
    ------
    OSError
        If it was deleted, moved or replaced, or its folder may not be written any more.
    """
    try:
        is_there = os.path.samestat(path.stat(), os.fstat(stream.fileno()))
    except (FileNotFoundError, NotADirectoryError):
        is_there = False
    if not is_there:
        raise OSError("deleted or moved while it was written")
    if not os.access(path.parent, os.W_OK):
        raise OSError("the folder may not be written any more")
