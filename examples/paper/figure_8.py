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

"""Fig. 8: the same sines, MBW alone: the dc gain of G in place of G.

The loop of the stage widens with frequency, that of the model does not. On a stage that shares no code with the model
the error is the row that the published coefficients predict (table_1.py).
"""

from __future__ import annotations

import published
from exhibit import STATIC, Exhibit, canvas, main
from table_1 import lag_error
from two_stages import alone, joint
from validation import draw_loops


def figure_8() -> Exhibit:
    """Loops of MBW alone at the frequencies of Table 1."""
    figure, axes = canvas(2, 3, sharex=True, sharey=True)
    model = alone(joint("bouc_wen").model)
    row = draw_loops(axes, model, "bouc_wen", "MBW alone", {"color": STATIC})
    return Exhibit(
        "figure_8",
        figure,
        {
            "frequency [Hz]": list(published.FREQUENCIES),
            "MBW alone, simulated stage [% of peak-to-peak]": row,
            "lag of the published G [% of peak-to-peak]": [lag_error(f) for f in published.FREQUENCIES],
            "MBW alone, paper [%]": list(published.MBW_ROW),
        },
    )


if __name__ == "__main__":
    main(figure_8)
