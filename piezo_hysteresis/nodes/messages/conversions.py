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

"""Messages <-> arrays and plain values: one waveform, one status, one time."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import Header

from ...errors import RecordError, printable
from .cloud import from_cloud, to_cloud
from .phase_text import PHASE_FIELD, phase_text

_END_OF_TIME = 2**31 * 1_000_000_000
"""Messages count seconds in 32 bits, and this time [ns] is the first one that does not fit."""

_SEVERITY = (DiagnosticStatus.OK, DiagnosticStatus.STALE, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)
"""Levels from good to bad. The number of STALE is the largest, although it only says that nothing is known."""

Samples = NDArray[np.float64]

COMMAND = {"time": "f8", "voltage": "f8"}
"""Point of `command`; `time` is optional."""

PERIOD_TOLERANCE = 0.01
"""Largest deviation of a sample from its nominal time, in sample periods."""


def command_to_cloud(voltage: ArrayLike, sample_period: float, phase: str, stamp: Time | None = None) -> PointCloud2:
    """Message of `command`: a waveform that begins the phase named `phase`.

    Parameters
    ----------
    voltage : (n,) array_like
        Drive voltage [V].
    sample_period : float
        Time between samples [s]; it has to be that of the driver.
    phase : str
        Name of the phase.
    stamp : builtin_interfaces.msg.Time, optional
        Time of sending; without it the driver does not check the age of the command.
    """
    values = np.asarray(voltage, dtype=np.float64)
    columns = {"time": sample_period * np.arange(values.size), "voltage": values}
    return with_phase(to_cloud(columns, COMMAND, stamp or Time()), phase)


def with_phase(cloud: PointCloud2, phase: str) -> PointCloud2:
    """The same waveform with the name of its phase: a second name of the bytes of its last field."""
    column = cloud.fields[-1]
    name = PointField(name=PHASE_FIELD + phase, offset=column.offset, datatype=column.datatype, count=1)
    cloud.fields = [*cloud.fields, name]
    return cloud


def phase_text_of(cloud: PointCloud2, frame: str) -> str:
    """Text that names the phase of a waveform, as from `phase_text`."""
    return phase_text((field.name for field in cloud.fields), cloud.header.frame_id, frame)


def waveform_from_cloud(cloud: PointCloud2, sample_period: float) -> Samples:
    """Waveform of a message of `command` [V], shape (n,).

    Raises
    ------
    RecordError
        On a cloud without `voltage`, or a `time` that does not agree with `sample_period`.
    """
    arrays = from_cloud(cloud, {"voltage": "f8"}, {"time": "f8"})
    time, voltage = arrays.get("time"), arrays["voltage"]
    if time is not None:
        with np.errstate(over="ignore"):  # infinite is too far off, too
            off = np.abs(time - time[0] - sample_period * np.arange(time.size))
        if off.max() > PERIOD_TOLERANCE * sample_period:
            got = (float(time[-1]) - float(time[0])) / (time.size - 1)
            raise RecordError(
                f"time: got a period of {got:g} s ({off.max():.3g} s off at worst), expected {sample_period:g} s"
            )
    return voltage


def live(stamp: Time, frame_id: str, **values: float) -> JointState:
    """Stamped scalars by name, in `position`: PlotJuggler and Foxglove draw loops from it."""
    return JointState(header=Header(stamp=stamp, frame_id=frame_id), name=list(values), position=list(values.values()))


def diagnostic(level: bytes, name: str, message: str, hardware_id: str = "", **values: object) -> DiagnosticStatus:
    """Status with its values as text, floats with six digits. Characters that cannot be printed are replaced."""
    texts = {key: f"{value:.6g}" if isinstance(value, float) else str(value) for key, value in values.items()}
    return DiagnosticStatus(
        level=level,
        name=printable(name),
        message=printable(message),
        hardware_id=printable(hardware_id),
        values=[KeyValue(key=key, value=printable(text)) for key, text in texts.items()],
    )


def worst(*levels: bytes) -> bytes:
    """The level of a status that has several things to report.

    >>> worst(DiagnosticStatus.STALE, DiagnosticStatus.ERROR) == DiagnosticStatus.ERROR
    True
    """
    return max(levels, key=_SEVERITY.index)


def values_of(status: DiagnosticStatus) -> dict[str, str]:
    """Values of a status by key."""
    return {pair.key: pair.value for pair in status.values}


def to_stamp(nanoseconds: int) -> Time:
    """Message time of nanoseconds since the epoch; the latest one that a message holds is in January 2038."""
    seconds, rest = divmod(min(nanoseconds, _END_OF_TIME - 1), 1_000_000_000)
    return Time(sec=seconds, nanosec=rest)


def from_stamp(stamp: Time) -> int:
    """Nanoseconds since the epoch of a message time.

    Raises
    ------
    RecordError
        If the nanoseconds are a full second or more.
    """
    if stamp.nanosec >= 1_000_000_000:
        raise RecordError(f"stamp: got {stamp.nanosec} ns, expected less than a second")
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
