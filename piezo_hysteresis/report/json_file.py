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

"""Results as a JSON file, which is written atomically."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from ..errors import RecordingError
from ..home_path import in_home
from ..recording.whole_file import whole_file
from ..yaml_file import read_regular_file


def write_json(path: str, answer: Mapping[str, Any]) -> None:
    """Write `answer`; numbers that are not finite become null.

    Raises
    ------
    RecordingError
        If the file cannot be written.
    """
    place = in_home(path)
    text = json.dumps(_plain(answer), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    try:
        if place.exists() and not place.is_file():  # a pipe or /dev/stdout cannot be replaced
            place.write_text(text, encoding="utf-8")
            return
        with whole_file(place) as draft:
            draft.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}, expected a file that can be written") from None


def read_json(path: str) -> dict[str, Any]:
    """Read an answer.

    Raises
    ------
    RecordingError
        If there is no such file, or it is not a JSON object.
    """
    place = in_home(path)
    try:
        answer = json.loads(read_regular_file(place))
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}, expected a JSON file") from None
    except (ValueError, RecursionError):
        raise RecordingError(f"{path}: damaged or no JSON, expected the answer of `piezo diagnose --json`") from None
    if not isinstance(answer, dict):
        raise RecordingError(f"{path}: got a {type(answer).__name__}, expected the answer of `piezo diagnose --json`")
    return answer


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value.item() if hasattr(value, "item") else value
