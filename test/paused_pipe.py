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

"""Pipes as terminals that are paused."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress


@contextmanager
def paused_pipe(is_full: bool = True) -> Iterator[tuple[int, int]]:
    """A pipe that nobody reads: the descriptors of its two ends."""
    read, write = os.pipe()
    try:
        if is_full:
            fill(write)
        yield read, write
    finally:
        for descriptor in (read, write):
            with suppress(OSError):  # a test has closed it
                os.close(descriptor)


def fill(write: int) -> None:
    """Fill a pipe to its last byte; to write to it still blocks."""
    own = os.open(f"/proc/self/fd/{write}", os.O_WRONLY | os.O_NONBLOCK)
    with suppress(BlockingIOError):
        while True:
            os.write(own, b"x" * 100)
    with suppress(BlockingIOError):
        while True:
            os.write(own, b"x")
    os.close(own)
