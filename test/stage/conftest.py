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

import pytest

from piezo_hysteresis.stage.plant import PlantParameters

IDEAL = {"sensor.noise": 0.0, "sensor.adc_bits": 0, "electronics.dac_bits": 0}
LINEAR = {"hysteresis.A": 0.0, "hysteresis.beta": 0.0, "hysteresis.gamma": 0.0, "hysteresis.p1": 0.0}


@pytest.fixture
def ideal():
    """The default plant with ideal converters and no noise, changed as asked."""
    return lambda **changes: PlantParameters.from_mapping({**IDEAL, **_dotted(changes)})


@pytest.fixture
def linear():
    """The same without hysteresis: w = p2 v."""
    return lambda **changes: PlantParameters.from_mapping({**IDEAL, **LINEAR, **_dotted(changes)})


def _dotted(changes):
    return {name.replace("__", "."): value for name, value in changes.items()}
