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

"""`Source`: one recording with its location, its stage and its date."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from ..errors import ParameterError
from .storage import Storage

UNKNOWN = "unknown"
"""Name of an unknown stage or month."""
_DATE = re.compile(
    r"(?<!\d)(20\d\d)[-_]?([01]\d)[-_]?([0-3]\d)(?:[T _-]?([0-2]\d)[-:_]?([0-5]\d)(?:[-:_]?([0-5]\d))?)?"
)
"""A date with or without a time of day, as in file names."""
_STAGE = re.compile(r"(?:^|/)stage=([^/]+)")
"""A folder with the name of the stage, as in the results of a fleet."""


@dataclass(frozen=True, slots=True)
class Source:
    """A recording that has not been read.

    Parameters
    ----------
    url : str
        Path or URL; it identifies the recording.
    files : tuple of str
        Paths of its files in the storage.
    folder : str
        Path of the folder of the recording; empty for a single file.
    storage : Storage
        Storage that opens the URL.
    stage : str
        Name of the stage.
    recorded_at : datetime or None
        Time of the recording [UTC]; None if neither the URL nor the storage contains it.
    version : str
        Sizes and modification times (or tags) of the files, as listed by the storage. If they differ, the data may have
        changed. Empty if the storage does not list them.
    """

    url: str
    files: tuple[str, ...]
    folder: str
    storage: Storage
    stage: str
    recorded_at: datetime | None
    version: str

    @property
    def month(self) -> str:
        """Year and month, e.g. ``"2026-11"``."""
        return UNKNOWN if self.recorded_at is None else f"{self.recorded_at:%Y-%m}"


@dataclass(frozen=True, slots=True)
class NamePattern:
    """Pattern that finds stage and date in a URL.

    Parameters
    ----------
    text : str
        Regular expression with a group ``stage``, a group ``date`` or both. If it is empty, the stage is the folder of
        the recording, and the date is the first date in the URL.

    Raises
    ------
    ParameterError
        If `text` is not a regular expression, or has neither group.
    """

    text: str = ""

    def __post_init__(self) -> None:
        try:
            groups = re.compile(self.text).groupindex if self.text else {"stage": 1}
        except re.error as error:
            raise ParameterError(f"name: got '{self.text}', expected a regular expression ({error})") from None
        if not {"stage", "date"} & set(groups):
            raise ParameterError(f"name: got '{self.text}', expected a group (?P<stage>…) or (?P<date>…) in it")

    def stage(self, url: str) -> str:
        """The stage in a URL.

        >>> NamePattern().stage("s3://lab/stage_7/2026-11-03.npz"), NamePattern("(?P<stage>[0-9]+)_").stage("/1_x.csv")
        ('stage_7', '1')
        """
        if named := self._group(url, "stage"):
            return named
        if found := _STAGE.search(url):
            return found[1]
        folders = url.partition("://")[2].rstrip("/").split("/") if "://" in url else url.rstrip("/").split("/")
        return (folders[-2] if len(folders) > 1 else "") or UNKNOWN

    def date(self, url: str, changed: datetime | None) -> datetime | None:
        """Time of a recording; if the URL contains none, the modification time of its newest file.

        >>> NamePattern().date("/lab/x/20261103T1530.npz", None).isoformat()
        '2026-11-03T15:30:00+00:00'
        """
        for found in _DATE.finditer(self._group(url, "date") or url):
            try:
                year, month, day, hour, minute, second = (int(part or 0) for part in found.groups())
                return datetime(year, month, day, hour, minute, second, tzinfo=UTC)
            except ValueError:
                continue
        return changed

    def _group(self, url: str, name: str) -> str:
        found = re.search(self.text, url) if self.text else None
        return (found.groupdict().get(name) or "") if found else ""


def version_of(infos: list[dict[str, Any]]) -> str:
    """Sizes and times (or tags) of files as text; empty if the storage lists neither for one of the files."""
    parts = []
    for info in infos:
        mark = info.get("ETag") or info.get("mtime") or info.get("Last-Modified") or info.get("LastModified")
        if mark is None:
            return ""
        parts.append(f"{info.get('size')} {mark}")
    return "; ".join(parts)


def changed_at(infos: list[dict[str, Any]]) -> datetime | None:
    """Modification time of the newest file [UTC]."""
    times = []
    for info in infos:
        time = info.get("mtime") or info.get("LastModified")
        if isinstance(time, int | float):
            times.append(datetime.fromtimestamp(time, UTC))
        elif isinstance(time, datetime):
            times.append(time if time.tzinfo else time.replace(tzinfo=UTC))
    return max(times, default=None)
