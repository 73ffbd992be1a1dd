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

"""Fig. 7: sines of 1 to 400 Hz, the dynamic model in free run against the measurement; nothing here was fitted.

The joint fit reaches the noise of the sensor at every frequency. The error of the three steps alone, on the same stage
and data, grows with frequency as the paper's does: the G of step 2 holds a part of the hysteresis.
"""

from __future__ import annotations

import numpy as np
import published
from exhibit import DYNAMIC, Exhibit, canvas, main
from two_stages import joint, last_period, plant, published_steps
from validation import draw_loops, error_row, sine


def figure_7() -> Exhibit:
    """Loops of the dynamic model at the frequencies of Table 1."""
    figure, axes = canvas(2, 3, sharex=True, sharey=True)
    row = draw_loops(axes, joint("bouc_wen").model, "bouc_wen", "dynamic model", {"color": DYNAMIC})
    stage, record = plant("bouc_wen"), sine("bouc_wen", 50.0)
    stroke = float(np.ptp(record.displacement[last_period(record, 50.0)]))
    return Exhibit(
        "figure_7",
        figure,
        {
            "frequency [Hz]": list(published.FREQUENCIES),
            "dynamic model, joint fit [% of peak-to-peak]": row,
            "dynamic model, three steps alone [% of peak-to-peak]": error_row(
                published_steps("bouc_wen").model, "bouc_wen"
            ),
            "dynamic model, paper [%]": list(published.DYNAMIC_ROW),
            "sensor noise [% of peak-to-peak]": 100.0 * stage.sensor.noise * stage.full_stroke / stroke,
        },
    )


if __name__ == "__main__":
    main(figure_7)
