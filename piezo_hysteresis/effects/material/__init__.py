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

"""Effects of the material: laws of creep. Every file of this folder is in the catalogue, without being listed."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from ..effect import Effect


def _laws() -> tuple[type[Effect], ...]:
    modules = [import_module(f"{__name__}.{found.name}") for found in iter_modules(__path__)]
    classes = [(module, value) for module in modules for value in vars(module).values() if isinstance(value, type)]
    return tuple(c for module, c in classes if issubclass(c, Effect) and c.__module__ == module.__name__)


LAWS_OF_CREEP: tuple[type[Effect], ...] = _laws()
"""Every law, in the order of the names of the files; they act at the same place of the chain."""
