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

"""The packages of the extra `fleet`, which the rest of the package does not need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import MissingPackageError


def package(name: str) -> Any:
    """A module of the extra, or of a package that it depends on.

    Parameters
    ----------
    name : str
        Name of the module, e.g. ``"pyarrow.parquet"``.

    Raises
    ------
    MissingPackageError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise MissingPackageError("fleet", name.partition(".")[0], "fleet") from None
