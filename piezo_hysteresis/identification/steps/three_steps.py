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

"""The three steps as published: delay, ARX from v, MBW from w(i) = y(i + d)/K (paper, Sec. 3).

They do not return the published model from data simulated with it: under noise the hysteresis state loses its memory,
and the ARX model absorbs a part of the hysteresis. The joint identification starts from here and corrects this.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects import HYSTERESIS, Arx, HysteresisOperator, Offset
from ...errors import IdentificationError
from ...model.model import Model
from ...record import Record
from ..fit.fit import Fit
from ..records.excitation_content import excited_part
from .delay import Delay, identify_delay
from .dynamics import Dynamics, identify_arx
from .hysteresis import fit_hysteresis
from .linear_start import dynamics_of
from .regressors import Signals


@dataclass(frozen=True, eq=False, slots=True)
class ThreeSteps:
    """Result of the published identification.

    Parameters
    ----------
    delay : Delay
        Step 1.
    dynamics : Dynamics
        Step 2, ARX from v to the normalised displacement.
    loop : Fit
        Step 3; its model contains all effects.
    """

    delay: Delay
    dynamics: Dynamics
    loop: Fit

    @property
    def model(self) -> Model:
        """The identified chain."""
        return self.loop.model

    def __str__(self) -> str:
        loop = ", ".join(f"{n.split('.')[1]} = {v:.5g}" for n, v in self.loop.values.items())
        return f"1 {self.delay}\n2 {self.dynamics}\n3 MBW: {loop}"


def voltage_signals(records: Sequence[Record], voltage_scale: float, displacement_scale: float) -> Signals:
    """(v, y) of the excited part of every record, for ARX from the voltage."""
    parts = [excited_part(r) for r in records]
    return [(np.array(r.voltage / voltage_scale), np.array(r.displacement / displacement_scale)) for r in parts]


def named(records: Sequence[Record], phase: str) -> list[int]:
    """Indices of the records of a phase."""
    return [i for i, r in enumerate(records) if r.phase.split("_")[0] == phase]


def three_steps(
    records: Sequence[Record],
    *,
    voltage_scale: float,
    displacement_scale: float,
    orders: tuple[int, int] = (8, 8),
    hysteresis: type[HysteresisOperator] = HYSTERESIS,
    delay: Delay | None = None,
) -> ThreeSteps:
    """Run the published identification on the phases `step`, `noise` and `triangle` of an experiment.

    Parameters
    ----------
    records : sequence of Record
        The experiment, in order; the other phases only determine the state of the stage.
    voltage_scale, displacement_scale : float
        Scales of the model [V], [m].
    orders : (int, int)
        na and nb.
    hysteresis : type of HysteresisOperator
        Hysteresis operator; `PublishedBoucWen` for data that were computed by Eq. (7).
    delay : Delay, optional
        Result of step 1, if it is known.

    Raises
    ------
    IdentificationError
        If one of the three phases is missing, or does not determine its step.
    """
    step, noise, triangle = (named(records, phase) for phase in ("step", "noise", "triangle"))
    step = step or named(records, "steps") or named(records, "staircase")
    for phase, found in (("step", step), ("noise", noise), ("triangle", triangle)):
        if not found:
            raise IdentificationError(f"three steps: got no {phase} phase, expected step, noise and triangle")
    period = min(records[i].sample_period for i in noise)
    if delay is None:
        delay = identify_delay([records[i] for i in step])
    dynamics = identify_arx(
        voltage_signals(
            [records[i] for i in noise if records[i].sample_period < 1.001 * period], voltage_scale, displacement_scale
        ),
        max(1, round(delay.time / period)),
        period,
        orders,
    )
    follower = Arx(a=(), b=(dynamics.arx.dc_gain,), delay=max(1.0, delay.time / period))
    loop = fit_hysteresis(Model((hysteresis(), follower), period, voltage_scale, displacement_scale), records, triangle)
    whole = loop.model.with_effect(dynamics.arx).with_effect(Offset(y0=float(np.mean([n[0] for n in loop.nuisances]))))
    return ThreeSteps(delay, dynamics, replace(loop, model=whole))


def behind_the_gauge(
    frame: Model, published: ThreeSteps | None, records: Sequence[Record], loops: Collection[int]
) -> Model:
    """`frame` with its hysteresis fitted to the loops; if step 3 was done, only its gain is changed.

    Parameters
    ----------
    frame : Model
        Model with the chosen dc gain and the delay.
    published : ThreeSteps or None
        Result of the published steps.
    records : sequence of Record
        The experiment, in order.
    loops : collection of int
        Indices of the records that show the hysteresis.
    """
    if published is None or set(loops) != set(named(records, "triangle")):
        return fit_hysteresis(frame, records, loops).model
    gain = published.dynamics.arx.dc_gain / dynamics_of(frame).dc_gain
    return frame.with_hysteresis(published.model.hysteresis.scaled(gain))
