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

"""Stages whose amplifier and sensor are wired to a National Instruments card.

``stage`` is the back end, ``setup`` its wiring and scales, and ``back_end`` its parameters for the driver.
``loop_back`` measures the delay of the card alone. The optional package ``nidaqmx[grpc]`` is needed.
"""

from ..opening import BackEnd
from .back_end import PARAMETERS, open

__all__ = ["BACK_END", "PARAMETERS", "open"]

BACK_END = BackEnd("nidaqmx", PARAMETERS, open, is_device=True, has_keeper=True, keeper_ends_driver=True)
"""Found by `back_ends`."""
