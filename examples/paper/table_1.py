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

"""Table 1, row of MBW alone: the part that is caused by the lag of G alone.

The published model is taken as the truth; MBW alone is its hysteresis with the dc gain of G instead of G. The
difference is the phase lag of G. In quadrature with the published row of the dynamic model it gives the row of MBW.
"""

from __future__ import annotations

import numpy as np
import published
from exhibit import DYNAMIC, MEASURED, STATIC, Exhibit, canvas, main


def lag_error(frequency: float, periods: int = 3) -> float:
    """RMS difference between dc gain and G on the hysteresis output, in % of peak-to-peak, last period."""
    model, u = published.MODEL, published.sine(frequency, periods)
    y, _ = model.run(u, model.rest(u[0]))
    hysteresis = model.without("arx")
    w, _ = hysteresis.run(u, hysteresis.rest(u[0]))
    last = slice(-u.size // periods, None)
    return published.percent_of_range(y[last] - model["arx"].dc_gain * w[last], y[last])


def table_1() -> Exhibit:
    """The row of MBW alone from the published coefficients and the published row of the dynamic model."""
    lag = [lag_error(f) for f in published.FREQUENCIES]
    together = np.hypot(lag, published.DYNAMIC_ROW)
    off = 100.0 * np.max(np.abs(together / published.MBW_ROW - 1.0))

    figure, (ax,) = canvas()
    ax.plot(published.FREQUENCIES, published.MBW_ROW, "o-", color=MEASURED, label="paper, MBW alone")
    ax.plot(published.FREQUENCIES, together, "s--", color=STATIC, label="lag of G and dynamic row, in quadrature")
    ax.plot(published.FREQUENCIES, lag, "^:", color=DYNAMIC, label="lag of the published G alone")
    ax.set(xlabel="frequency [Hz]", ylabel="RMS error [% of peak-to-peak]")
    ax.set_title(f"Table 1: within {off:.1f} % of the published row")
    ax.legend()
    return Exhibit(
        "table_1",
        figure,
        {
            "frequency [Hz]": list(published.FREQUENCIES),
            "lag of G [% of peak-to-peak]": lag,
            "with the dynamic row [%]": together.tolist(),
            "largest departure from the published row [%]": float(off),
        },
    )


if __name__ == "__main__":
    main(table_1)
