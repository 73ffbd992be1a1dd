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

"""`Storage`: gives access to the files at a URL: on a disk, on an S3 server or on a web server."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cache
from typing import Any
from urllib.parse import urlsplit

from ..errors import RecordingError, printable
from ..home_path import in_home
from .extra import package


@dataclass(frozen=True, slots=True)
class Storage:
    """Access to URLs. Keys for S3 come from the environment or from ``~/.aws``.

    Parameters
    ----------
    endpoint : str, optional
        URL of an S3 server other than Amazon's; default: the environment variable ``AWS_ENDPOINT_URL``, if it is set.
    anonymous : bool
        Whether S3 is used without keys, for public buckets.
    """

    endpoint: str | None = field(default_factory=lambda: os.environ.get("AWS_ENDPOINT_URL"))
    anonymous: bool = False

    def open(self, url: str) -> tuple[Any, str]:
        """The fsspec file system of `url`, and the path in it.

        Raises
        ------
        RecordingError
            If the URL has an unknown scheme, or its bucket cannot be read.
        """
        scheme = urlsplit(url).scheme if "://" in url else ""
        if scheme == "s3":
            bucket = url.removeprefix("s3://").partition("/")[0]
            return _s3(bucket, self.endpoint, self.anonymous), url[5:].rstrip("/")
        if not scheme:
            return _disk(), os.path.abspath(in_home(url))
        fsspec = package("fsspec")
        try:
            fs, path = fsspec.core.url_to_fs(url)
        except (ValueError, ImportError) as error:
            raise RecordingError(
                f"{url}: {printable(str(error))}; expected a local path, s3://, http:// or https://"
            ) from None
        return fs, path


@cache
def _disk() -> Any:
    return package("fsspec").filesystem("file")


@cache
def _s3(bucket: str, endpoint: str | None, anonymous: bool) -> Any:
    """The S3 client of Arrow with the interface of fsspec.

    The usual S3 client of fsspec (s3fs) needs python-dateutil below 3, see docs/decisions/0025.
    """
    wrapper = package("fsspec.implementations.arrow").ArrowFSWrapper
    arrow = package("pyarrow.fs")
    try:
        if endpoint is not None:
            parts = urlsplit(endpoint)
            region = os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION") or "us-east-1"
            return wrapper(
                arrow.S3FileSystem(
                    anonymous=anonymous, endpoint_override=parts.netloc, scheme=parts.scheme or "https", region=region
                )
            )
        region = arrow.resolve_s3_region(bucket)
        return wrapper(arrow.S3FileSystem(anonymous=anonymous, region=region))
    except (OSError, ValueError) as error:
        raise RecordingError(f"s3://{bucket}: {printable(str(error))}; expected a bucket that can be read") from None
