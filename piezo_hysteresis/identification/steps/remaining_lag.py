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

"""The lag of the stage and its uncertainty, which is all that slow drives show of the dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from ...effects import AmplifierBandwidth, AmplifierBandwidthHeld, Arx, ExtraResonance
from ...errors import ParameterError
from ...model.model import Model
from ...parameter import number_text
from ...record import Notice
from ..fit.fit import Fit
from ..records.excitation_content import ExcitationContent, moving
from ..structure.mode import lag_of_mode, mode_is_inferred
from .linear_start import dynamics_of

ONE_FREQUENCY = 4
"""Largest number of spectral lines of a drive with one frequency."""
AMPLIFIERS = (AmplifierBandwidth, AmplifierBandwidthHeld)
"""Forms of a pole before the hysteresis."""
LATE = (Arx.name, *(form.name for form in AMPLIFIERS))
"""Effects whose lag is stated."""
STATED = 0.01
"""Error, as a share of the range of a sine, for which the notice states the frequency."""


def lag(fit: Fit) -> tuple[float, float]:
    """Lag of G and of the amplifier at low frequency and its standard error [s], from the covariance of the fit.

    The lag of an inferred mode is part of it, because the data determine only both together.
    """
    names = [n for n in fit.names if n.partition(".")[0] in LATE]

    def at(values: dict[str, float]) -> float:
        model = fit.model.with_values(values)
        return lag_beside_mode(model) + (lag_of_mode(model) if mode_is_inferred(model) else 0.0)

    value = at({})

    def slope(name: str) -> float:
        """∂lag/∂θ; a delay may be at its lower bound, and a pole at the edge of stability, so it is one-sided.

        Infinite if it is unknown.
        """
        size = max(1e-6 * abs(fit.values[name]), 1e-12)
        for step in (size, -size):
            with suppress(ParameterError):
                return (at({name: fit.values[name] + step}) - value) / step
        return np.inf

    slopes = np.array([slope(n) for n in names])
    if not np.isfinite(slopes).all():
        return value, np.inf
    rows = [fit.names.index(n) for n in names]
    variance = float(slopes @ fit.covariance[np.ix_(rows, rows)] @ slopes) if names else 0.0
    return value, float(np.sqrt(max(variance, 0.0)))


def lag_beside_mode(model: Model) -> float:
    """Group delay of G and of an amplifier before the hysteresis at low frequency [s]."""
    period, amplifier = model.sample_period, amplifier_of(model)
    return dynamics_of(model).group_delay * period + (amplifier.lag(period)[0] if amplifier else 0.0)


def amplifier_of(model: Model) -> AmplifierBandwidth | None:
    """The low-pass before the hysteresis, of either form; None without one."""
    return next((e for e in model.effects if isinstance(e, AmplifierBandwidth)), None)


def error_of_lag(late: float, frequency: float) -> float:
    """RMS error of a sine that is `late` [s] too late, as a share of its range: sin(π f t)/√2.

    Examples
    --------
    >>> round(error_of_lag(50e-6, 60.0), 5)
    0.00666
    """
    return float(np.sin(min(np.pi * frequency * late, 0.5 * np.pi)) / np.sqrt(2.0))


def lag_notices(fit: Fit, contents: Sequence[ExcitationContent], *, rivals_counted: bool = False) -> tuple[Notice, ...]:
    """Notices ``lag_only``, and ``one_frequency`` if lag and hysteresis cannot be distinguished.

    Parameters
    ----------
    fit : Fit
        The joint fit.
    contents : sequence of ExcitationContent
        Excitation of the fitted records.
    rivals_counted : bool
        Whether the covariance of the fit includes the influence of other plays and rates of creep on the lag.
    """
    value, error = lag(fit)
    driven = moving(contents)
    highest = max([c.highest for c in driven if not c.is_step] or [0.0])
    ends = f"no record is broadband and the drive ends at {highest:.3g} Hz" if highest else "no record is broadband"
    known_to = np.arcsin(STATED * np.sqrt(2.0)) / (np.pi * 1.96 * error) if error > 0.0 else np.inf
    besides = beyond = ""
    if mode_is_inferred(fit.model):
        besides, beyond = " together with the mode", f"above {highest:.3g} Hz, the gain is not known; "
    elif ExtraResonance.name in fit.model:
        besides = " besides the mode"
    notices = [
        Notice(
            "lag_only",
            f"{ends}, so only a lag is reported for the dynamics{besides}, "
            f"{number_text(1e3 * value, 1.96e3 * error)} ms ± {1.96e3 * error:.2g} ms (95 %); above "
            f"{known_to:.2g} Hz, this uncertainty allows an error of more than {100 * STATED:.0f} % of the range; "
            f"{beyond}record noise or a chirp to identify the dynamics",
        )
    ]
    if max(c.lines for c in driven) <= ONE_FREQUENCY and max(c.bandwidth for c in driven) <= 1.5 * min(
        c.bandwidth for c in driven
    ):
        message = "the drive has only one frequency, at which a lag and a narrow backlash look alike; "
        known = "the lag's interval includes both" if rivals_counted else "the lag is less certain than its interval"
        notices.append(Notice("one_frequency", message + known))
    return tuple(notices)
