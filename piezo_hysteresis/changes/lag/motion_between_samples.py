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

"""`unseen_lag`: what samples do not show of a lag, because they do not show when between them a stage moves."""

from __future__ import annotations

import numpy as np
import scipy

from ...effects import ExtraResonance
from ...identification.structure.mode import mode_is_inferred
from ...model.model import Model
from ...model.parameter_covariance import linear_sections

SETTLES = 256
"""Number of samples of the response to a step."""


def unseen_lag(model: Model) -> float:
    """Half the interval of a lag that a change of the time of motion between two samples allows [s].

    The converter holds every sample, so what a model passes of a step within one sample, a stage passes at any time
    in it; a stage that overshoots passes the step within one sample all the same. A mode that was found in the records
    is known between samples, too, and nothing is left open.
    """
    if ExtraResonance.name in model and not mode_is_inferred(model):
        return 0.0
    response = np.ones(SETTLES)
    for numerator, denominator in linear_sections(model):
        response = scipy.signal.lfilter(numerator, denominator, response)
    share = np.abs(np.diff(response, prepend=0.0)).max() / abs(response[-1])
    return float(min(1.0, share) * model.sample_period)
