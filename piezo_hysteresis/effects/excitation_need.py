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

"""`ExcitationNeed`: the kind of drive that an experiment must contain to show an effect."""

from __future__ import annotations

from enum import Enum, auto


class ExcitationNeed(Enum):
    """Kinds of drive; an effect declares the one that it needs to be visible."""

    HELD_LEVEL = auto()
    """A level that is held for a second or more after a change."""
    REPEATED_PHASE = auto()
    """The same kind of phase, recorded at two times."""
    SEVERAL_AMPLITUDES = auto()
    """Loops of two or more amplitudes, from a slow drive or from sines or triangles."""
    BROADBAND = auto()
    """A step, noise or a multisine, which excite the dynamics."""
