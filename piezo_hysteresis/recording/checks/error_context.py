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

"""Errors of decoders of foreign files, converted to one clear line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...errors import PiezoError, RecordError, RecordingError


@contextmanager
def naming(path: Path, expected: str) -> Iterator[None]:
    """Convert every failure in the block into an error that names the file.

    Decoders of other formats raise any kind of error on damaged bytes, so that all errors are caught. The tests read
    intact files and therefore show programming errors.

    Parameters
    ----------
    path : Path
        File or folder that is read or written.
    expected : str
        What the file should have been, e.g. ``"a rosbag2 bag"``.

    Raises
    ------
    RecordError
        Where the samples form no record.
    RecordingError
        For everything else.
    """
    try:
        yield
    except RecordError as error:
        raise RecordError(_named(path, error)) from None
    except PiezoError as error:
        raise RecordingError(_named(path, error)) from None
    except MemoryError:
        raise RecordingError(f"{path}: more than the memory holds; give `rows` or a larger `average`") from None
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file or folder, expected {expected}") from None
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}, expected {expected}") from None
    except Exception as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise RecordingError(f"{path}: damaged or not {expected} ({reason})") from error


def _named(path: Path, error: PiezoError) -> str:
    text = " ".join(str(error).split())
    return text if text.startswith(str(path)) else f"{path}: {text}"
