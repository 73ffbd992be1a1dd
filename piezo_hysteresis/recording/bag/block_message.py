"""`BlockMessage`: one message of the topic `samples`, as arrays."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from ...errors import RecordingError
from ...record import CHANNELS, Samples

TYPE = "sensor_msgs/msg/PointCloud2"

FIELDS = np.dtype(
    {
        "names": ["time", "voltage", "displacement", "index", "phase"],
        "formats": ["<f8", "<f8", "<f8", "<u4", "<u4"],
        "offsets": [0, 8, 16, 24, 28],
        "itemsize": 32,
    }
)
"""Layout of one sample: time [s from the stamp], voltage [V], displacement [m], running index, phase number."""

_KINDS = dict.fromkeys((*CHANNELS, "time"), "f8") | {"index": "u4", "phase": "u4"}
_DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
_UINT32, _FLOAT64 = 6, 8


@functools.cache
def typestore() -> Typestore:
    """The message types of a ROS 2 installation."""
    return get_typestore(Stores.ROS2_KILTED)


@dataclass(frozen=True, eq=False, slots=True)
class BlockMessage:
    """Consecutive samples of a stage.

    Parameters
    ----------
    stamp_ns : int
        Time from which `time` counts [ns].
    channels : dict of str to (n,) ndarray
        `voltage` [V], `displacement` [m], and where there are such fields `other_displacement` [m], `temperature` [K].
    phase : (n,) ndarray of uint32
        Phase number of every sample; zeros where the message has none.
    time : (n,) ndarray, optional
        Time of every sample from the stamp [s].
    index : (n,) ndarray of uint32, optional
        Running number of every sample, modulo 2³².
    follows_pause : bool
        True where the samples before it were never measured, while the voltage was held: a device that reads out its
        memory.
    """

    stamp_ns: int
    channels: dict[str, Samples]
    phase: NDArray[np.uint32]
    time: Samples | None = None
    index: NDArray[np.uint32] | None = None
    follows_pause: bool = False

    @classmethod
    def from_cdr(cls, raw: bytes) -> BlockMessage:
        """Decode a serialised PointCloud2 by the names and offsets of its fields.

        Parameters
        ----------
        raw : bytes
            CDR with its encapsulation header.

        Raises
        ------
        RecordingError
            If the message has no voltage and displacement, or fewer bytes than it declares.
        """
        message: Any = typestore().deserialize_cdr(raw, TYPE)
        rows, step = int(message.width) * int(message.height), int(message.point_step)
        if rows == 0 or step == 0 or rows * step > message.data.size:
            raise RecordingError(f"block of {rows} samples with {step} bytes each has {message.data.size} bytes")
        fields = {field.name: field for field in message.fields if field.name in _KINDS}
        if "voltage" not in fields or "displacement" not in fields:
            names = ", ".join(field.name for field in message.fields)
            raise RecordingError(f"block has the fields {names}, expected voltage and displacement")
        layout = np.dtype(
            {
                "names": list(fields),
                "formats": [(">" if message.is_bigendian else "<") + _DATATYPES[f.datatype] for f in fields.values()],
                "offsets": [f.offset for f in fields.values()],
                "itemsize": step,
            }
        )
        cloud = np.frombuffer(message.data, layout, rows)
        columns: dict[str, NDArray[Any]] = {name: cloud[name].astype(_KINDS[name]) for name in fields}
        return cls(
            int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec),
            {name: columns[name] for name in CHANNELS if name in columns},
            columns["phase"] if "phase" in columns else np.zeros(rows, np.uint32),
            columns.get("time"),
            columns.get("index"),
            not message.is_dense,
        )

    def to_cdr(self, frame_id: str = "") -> bytes:
        """Serialised PointCloud2 of `FIELDS`, as the driver publishes it."""
        samples = np.zeros(self.phase.size, FIELDS)
        samples["voltage"], samples["displacement"] = self.channels["voltage"], self.channels["displacement"]
        samples["phase"] = self.phase
        for name in ("time", "index"):
            values = getattr(self, name)
            samples[name] = 0 if values is None else values
        kinds = typestore().types
        stamp = kinds["builtin_interfaces/msg/Time"](*divmod(self.stamp_ns, 1_000_000_000))
        field = kinds["sensor_msgs/msg/PointField"]
        fields = [
            field(name, int(at), _FLOAT64 if kind == np.float64 else _UINT32, 1)
            for name, (kind, at, *_) in (FIELDS.fields or {}).items()
        ]
        data = np.frombuffer(samples.tobytes(), np.uint8)
        cloud = kinds[TYPE](
            kinds["std_msgs/msg/Header"](stamp, frame_id),
            1, samples.size, fields, False, FIELDS.itemsize, data.size, data, not self.follows_pause,
        )  # fmt: skip
        return bytes(typestore().serialize_cdr(cloud, TYPE))
