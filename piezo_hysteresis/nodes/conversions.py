"""Messages <-> arrays and plain values: one block of samples, one waveform, one status."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Header

from ..errors import RecordError
from .cloud import from_cloud, to_cloud

Samples = NDArray[np.float64]

SAMPLES = {"time": "f8", "voltage": "f8", "displacement": "f8", "index": "u4", "phase": "u4"}
"""Point of `samples`: time@0, voltage@8, displacement@16, index@24, phase@28."""

PREDICTED_SAMPLES = {
    "time": "f8",
    "displacement": "f8",
    "prediction": "f8",
    "residual": "f8",
    "index": "u4",
    "model": "u4",
}
"""Point of `predicted_samples`: time@0, displacement@8, prediction@16, residual@24, index@32, model@36."""

COMMAND = {"time": "f8", "voltage": "f8"}
"""Point of `command`; `time` is optional."""

_PERIOD_TOLERANCE = 0.01
"""Largest departure of a sample from its place on the clock, in sample periods."""

_END_OF_TIME = 2**31
"""Messages count seconds in 32 bits."""

_LARGEST = {"voltage": 1e4, "displacement": 1.0}
"""What no piezo stage is driven with [V], and no piezo stage moves [m]."""


@dataclass(frozen=True, eq=False, slots=True)
class SampleBlock:
    """Consecutive samples of a stage, as one message of `samples`.

    Parameters
    ----------
    stamp : int
        Time of the first sample on the driver's clock [ns].
    time : (n,) ndarray of float64
        Time of every sample since the stamp [s].
    voltage : (n,) ndarray of float64
        Drive voltage before the amplifier [V].
    displacement : (n,) ndarray of float64
        Measured displacement [m].
    index : (n,) ndarray of uint32
        Running number of the sample, modulo 2^32.
    phase : (n,) ndarray of uint32
        Number of the phase.
    stage : str
        Name of the stage.
    follows_gap : bool
        True where samples before the block were never measured (a device reading out its memory), as told by the
        index; False where a jump of the index means lost messages.
    """

    stamp: int
    time: Samples
    voltage: Samples
    displacement: Samples
    index: NDArray[np.uint32]
    phase: NDArray[np.uint32]
    stage: str = ""
    follows_gap: bool = False

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def sample_period(self) -> float | None:
        """Time between samples [s]; None for a block of one."""
        return float(self.time[-1] - self.time[0]) / (self.size - 1) if self.size > 1 else None


def samples_to_cloud(block: SampleBlock) -> PointCloud2:
    """Message of `samples`."""
    columns = {name: getattr(block, name) for name in SAMPLES}
    return to_cloud(columns, SAMPLES, to_stamp(block.stamp), block.stage, dense=not block.follows_gap)


def samples_from_cloud(cloud: PointCloud2) -> SampleBlock:
    """Block of a message of `samples`, ours or foreign.

    Raises
    ------
    RecordError
        On missing or wrong fields, wrong sizes, values that are not finite or that no stage has, or samples that do not
        follow one another evenly.
    """
    arrays = from_cloud(cloud, SAMPLES)
    block = SampleBlock(
        from_stamp(cloud.header.stamp), **arrays, stage=cloud.header.frame_id, follows_gap=not cloud.is_dense
    )
    _require_consecutive(block)
    for name, largest in _LARGEST.items():
        values = getattr(block, name)
        if np.abs(values).max() > largest:
            worst = float(values[np.abs(values).argmax()])
            raise RecordError(f"samples: got a {name} of {worst:g}, expected at most {largest:g}")
    return block


def _require_consecutive(block: SampleBlock) -> None:
    count, places = _counting(block.size)
    jumps = block.index - block.index[0] != count
    if jumps.any():
        raise RecordError(f"samples: the index jumps at sample {int(jumps.argmax())}, expected consecutive samples")
    first, last = float(block.time[0]), float(block.time[-1])
    if not all(0 <= block.stamp * 1e-9 + time < _END_OF_TIME for time in (first, last)):
        raise RecordError(f"samples: got {first:g} to {last:g} s after the stamp {block.stamp} ns, expected a date")
    period = block.sample_period
    if period is None:
        return
    off = float(np.abs(block.time - first - period * places).max())
    if not off <= _PERIOD_TOLERANCE * period:
        raise RecordError(f"samples: times are {off:.3g} s off a period of {period:.6g} s, expected even ones")


@lru_cache(maxsize=2)
def _counting(size: int) -> tuple[NDArray[np.uint32], Samples]:
    """0, 1, 2, … as index and as number: a stream brings blocks of one size."""
    index, number = np.arange(size, dtype=np.uint32), np.arange(size, dtype=np.float64)
    for values in (index, number):
        values.setflags(write=False)
    return index, number


def predicted_to_cloud(
    block: SampleBlock, prediction: ArrayLike, residual: ArrayLike, model: int, *, valid: bool = True
) -> PointCloud2:
    """Message of `predicted_samples` for the samples of a block.

    Parameters
    ----------
    block : SampleBlock
        What was measured.
    prediction, residual : (n,) array_like
        Predicted displacement and measured minus predicted [m].
    model : int
        First 32 bits of the model's hash.
    valid : bool
        False while warming up or bridging a gap.
    """
    columns = {
        "time": block.time,
        "displacement": block.displacement,
        "prediction": prediction,
        "residual": residual,
        "index": block.index,
        "model": np.full(block.size, model, np.uint32),
    }
    return to_cloud(columns, PREDICTED_SAMPLES, to_stamp(block.stamp), block.stage, dense=valid)


def command_to_cloud(voltage: ArrayLike, sample_period: float, phase: str, stamp: Time | None = None) -> PointCloud2:
    """Message of `command`: a waveform that opens the phase named `phase`.

    Parameters
    ----------
    voltage : (n,) array_like
        Drive voltage [V].
    sample_period : float
        Time between samples [s]; the driver refuses another one than its own.
    phase : str
        Name of the phase.
    stamp : builtin_interfaces.msg.Time, optional
        Now; without it the driver does not check the age of the command.
    """
    values = np.asarray(voltage, dtype=np.float64)
    columns = {"time": sample_period * np.arange(values.size), "voltage": values}
    return to_cloud(columns, COMMAND, stamp or Time(), phase)


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
        off = np.abs(time - time[0] - sample_period * np.arange(time.size))
        if off.max() > _PERIOD_TOLERANCE * sample_period:
            got = float(time[-1] - time[0]) / (time.size - 1)
            raise RecordError(
                f"time: got a period of {got:g} s ({off.max():.3g} s off at worst), expected {sample_period:g} s"
            )
    return voltage


def live(stamp: Time, frame_id: str, **values: float) -> JointState:
    """Stamped scalars by name, in `position`: PlotJuggler and Foxglove draw loops from it."""
    return JointState(header=Header(stamp=stamp, frame_id=frame_id), name=list(values), position=list(values.values()))


def diagnostic(level: bytes, name: str, message: str, hardware_id: str = "", **values: object) -> DiagnosticStatus:
    """Status with its values as text; floats with six digits."""
    pairs = [KeyValue(key=key, value=f"{v:.6g}" if isinstance(v, float) else str(v)) for key, v in values.items()]
    return DiagnosticStatus(level=level, name=name, message=message, hardware_id=hardware_id, values=pairs)


def values_of(status: DiagnosticStatus) -> dict[str, str]:
    """Values of a status by key."""
    return {pair.key: pair.value for pair in status.values}


def to_stamp(nanoseconds: int) -> Time:
    """Message time of nanoseconds since the epoch."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=seconds, nanosec=rest)


def from_stamp(stamp: Time) -> int:
    """Nanoseconds since the epoch of a message time.

    Raises
    ------
    RecordError
        On a full second or more of nanoseconds.
    """
    if stamp.nanosec >= 1_000_000_000:
        raise RecordError(f"stamp: got {stamp.nanosec} ns, expected less than a second")
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
