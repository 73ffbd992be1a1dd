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

"""Stages on PI controllers with the General Command Set 2.0 over TCP.

``stage`` is the back end, ``setup`` its wiring and scales, and ``back_end`` its parameters for the driver. ``axis``
sends commands to one axis and reads its answers. ``client`` knows the syntax and the error queue, ``connection`` the
link, and ``array_answer`` the tables of numbers.
"""

from ..opening import BackEnd
from .back_end import PARAMETERS, open

__all__ = ["BACK_END", "PARAMETERS", "open"]

BACK_END = BackEnd("gcs2", PARAMETERS, open, is_device=True, has_keeper=True)
"""Found by `back_ends`."""
