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

"""A recording in place of a device, and how a driver opens it."""

from ..opening import BackEnd
from .back_end import PARAMETERS, open
from .stage import ReplayStage

__all__ = ["BACK_END", "PARAMETERS", "ReplayStage", "open"]

BACK_END = BackEnd("replay", PARAMETERS, open, is_device=False)
"""Found by `back_ends`."""
