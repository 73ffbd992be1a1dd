"""Does a record agree with the drive that was asked for? What lags passes; what stays apart does not."""

from __future__ import annotations

import numpy as np

from ..description import Samples
from .connection import Gcs2Error


def check_agreement(
    asked: Samples, voltage: Samples, displacement: Samples, tolerance: float, settling_samples: int
) -> None:
    """Refuse a record whose voltage is not the drive asked for, or whose displacement stands still.

    A difference of one sign that lasts longer than the settling time is no lag of the amplifier: saturation, exchanged
    channels, another sample period, a repeated block and a servo that was on all show so.

    Parameters
    ----------
    asked, voltage : (n,) ndarray
        Drive asked for and measured [V].
    displacement : (n,) ndarray
        Measured displacement [m].
    tolerance : float
        Largest steady difference of the voltages [V].
    settling_samples : int
        Samples within which the voltage follows a step.

    Raises
    ------
    Gcs2Error
        Naming the first sample of the difference.
    """
    difference = voltage - asked
    side = np.where(np.abs(difference) > tolerance, np.sign(difference), 0.0)
    edges = np.flatnonzero(np.diff(side, prepend=np.nan, append=np.nan))
    for first, end in zip(edges[:-1], edges[1:], strict=True):
        if side[first] and end - first > settling_samples:
            worst = first + int(np.argmax(np.abs(difference[first:end])))
            raise Gcs2Error(
                f"measured a drive of {voltage[worst]:g} V at sample {worst}, expected {asked[worst]:g} V within "
                f"{tolerance:g} V (samples {first} to {end - 1}): saturated, channels exchanged, or not the record of "
                "this waveform"
            )
    if np.ptp(voltage) > tolerance and np.ptp(displacement) == 0.0:
        raise Gcs2Error(
            f"the displacement stayed at exactly {displacement[0]:g} m while the drive moved by {np.ptp(voltage):g} V, "
            "expected a sensor that moves; stale readings, or no sensor on this axis"
        )
