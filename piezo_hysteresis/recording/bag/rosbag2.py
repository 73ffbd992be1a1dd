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

"""Reads a rosbag2 recording of the topics `samples` and `phase` as an experiment, and writes one."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import RecordingError, counted
from ...home_path import in_home
from ...parameter import parts_of
from ...record import Experiment, Notice, Record
from ..checks.error_context import naming
from ..segmentation.decimating_buffer import shared_averages
from ..table.read_options import IDLE, ReadOptions
from .bag import STORAGES, Bag
from .bag_writer import BagWriter
from .block_message import TYPE, BlockMessage, typestore
from .foreign_topics import read_topics
from .joined_axes import JoinedAxes
from .phase_topic import STRING, PhaseNames
from .recorded_phases import records_of
from .sample_stream import SampleStream

_BLOCK_DURATION = 0.01
"""Length of the messages that are written [s]."""

_LONGEST_SILENCE = 2**31 - 1
"""Largest number of samples by which the running index can jump ahead."""


class Rosbag2:
    """rosbag2 directory, .mcap or .db3 file, as the nodes or ``ros2 bag record -a`` write them.

    Phases that were recorded without an interruption continue each other: from the second one on `Record.continues` is
    true, also where the `hold` between them is left out. During such a hold the drive keeps its last voltage until the
    `start_time` of the next phase, so that slow states (creep) can be computed over it. A hold in which the drive moves
    is kept, because the state depends on it. The first phase starts settled at the voltage of the `idle` before it. A
    phase after lost samples continues and is `truncated`, because its state is known only approximately. The same holds
    for a phase whose beginning is not in the bag.
    """

    def recognises(self, path: Path) -> bool:
        """True for a storage file or a folder with one."""
        files = [path] if path.is_file() else path.iterdir()
        return any(f.suffix in (*STORAGES, ".zstd") or f.name == "metadata.yaml" for f in files)

    def read(self, path: Path, options: ReadOptions) -> Experiment:
        """The phases of one stage in the order in which they were recorded."""
        with naming(path, "a rosbag2 bag"):
            bag = Bag(path)
            if any(str(place).startswith("/") for place in options.columns.values()):
                records, notices = read_topics(bag, options)
            else:
                if options.rows is not None:
                    raise RecordingError(f"`rows`: got {options.rows} of a bag of phases, expected none; import it")
                records, notices = _read_samples(bag, options)
            return Experiment(tuple(records), str(path), (*bag.notices, *notices))

    def write(self, experiment: Experiment, path: Path) -> None:
        """Write the records as the driver would send them, in blocks of 10 ms, to the folder `path` without its ending.

        A folder that could not be written to its end is deleted.

        A record that does not continue the one before it is preceded by one idle sample at its settled voltage, as from
        a driver that was started again; a truncated one is not. Time between records in which the drive was held is
        written as a pause, without samples. Before a truncated record that continues, samples are missing. Other
        channels follow as further fields of the samples.

        Raises
        ------
        RecordingError
            If the folder exists or cannot be written, or a pause is longer than the running index can express.
        """
        bag = BagWriter(path.with_suffix("") if path.suffix == ".mcap" else path)
        try:
            with bag:
                _write_records(bag, experiment)
        except BaseException:
            shutil.rmtree(bag.path, ignore_errors=True)
            raise


def recorded_model(path: str | Path, *, axis: str | None = None) -> str | None:
    """The last model file on the topic `model` of a bag.

    Parameters
    ----------
    path : path-like
        rosbag2 directory or storage file.
    axis : str, optional
        Namespace of one stage where the bag holds several.

    Returns
    -------
    str or None
        Text of the model file; None if there is none.

    Raises
    ------
    RecordingError
        If the path is no bag.
    """
    place = in_home(path)
    text = None
    with naming(place, "a rosbag2 bag"):
        for message in Bag(place).messages():
            space = _space(message.topic, "model") if message.type == STRING else None
            if space is not None and (axis is None or space == _absolute(axis)):
                text = str(typestore().deserialize_cdr(message.raw, STRING).data)
    return text


def _absolute(axis: str) -> str:
    return "/" + axis.strip("/")


def _space(topic: str, name: str) -> str | None:
    """Namespace of a topic that is called `name`; None for other topics."""
    space, _, last = topic.rpartition("/")
    return _absolute(space) if last == name else None


def _axes(options: ReadOptions) -> list[str]:
    """Absolute namespaces in the option `axis`; RecordingError where one is given twice."""
    axes = [_absolute(part) for part in parts_of(options.axis or "")]
    if len(set(axes)) != len(axes):
        raise RecordingError(f"`axis`: got '{options.axis}', expected every namespace once")
    return axes


def _read_samples(bag: Bag, options: ReadOptions) -> tuple[list[Record], list[Notice]]:
    axes = _axes(options)
    if len(axes) > 1:
        return _read_joined(bag, axes, options)
    streams: dict[str, SampleStream] = {}
    names: dict[str, PhaseNames] = {}
    damaged = 0
    for message in bag.messages():
        space = _space(message.topic, "samples" if message.type == TYPE else "phase")
        if space is None or (axes and space not in axes):
            continue
        try:
            if message.type == TYPE:
                block = BlockMessage.from_cdr(message.raw)
                streams.setdefault(space, SampleStream(options.sample_period)).add(block, message.time_ns)
            elif message.type == STRING:
                names.setdefault(space, PhaseNames()).add(message.raw, message.time_ns)
        except Exception:  # the decoder raises any error on damaged bytes
            damaged += 1
        if len(streams) > 1:
            raise RecordingError(
                f"holds several stages, expected one; give `axis`: one of {', '.join(sorted(streams))}, or all of them "
                "with commas between for a stage of several axes"
            )
    if not streams:
        raise _no_samples(axes, damaged)
    (space, stream), *_ = streams.items()
    segments, notices = stream.segments(split_phases=options.phases is None)
    averages = shared_averages([s.size for s in segments], options.average)
    records, more = records_of(segments, averages, names.get(space, PhaseNames()), options)
    return records, [*_damage(damaged), *notices, *more]


def _read_joined(bag: Bag, axes: list[str], options: ReadOptions) -> tuple[list[Record], list[Notice]]:
    """One recording of the drivers of several axes, without phases: they begin at other times on every axis."""
    joined = JoinedAxes(axes, options.sample_period)
    received: list[int] = []
    damaged = 0
    for message in bag.messages([f"{axis.rstrip('/')}/samples" for axis in axes]):
        try:
            block = BlockMessage.from_cdr(message.raw)
        except Exception:  # the decoder raises any error on damaged bytes
            damaged += 1
            continue
        joined.add(_space(message.topic, "samples") or "", block)
        received = received or [message.time_ns]
    if joined.absent:
        raise _no_samples(joined.absent)
    segment = joined.segment(received[0])
    whole = replace(options, phases="record" if options.phases is None else options.phases)
    records, notices = records_of([segment], shared_averages([segment.size], options.average), PhaseNames(), whole)
    return records, [*_damage(damaged), *notices]


def _damage(count: int) -> list[Notice]:
    return [Notice("damaged", f"{count} messages could not be decoded and were skipped")] if count else []


def _no_samples(axes: list[str], damaged: int = 0) -> RecordingError:
    where = f" of {', '.join(axes)}" if axes else ""
    if damaged:
        return RecordingError(
            f"got no readable samples{where}: none of {counted(damaged, 'message')} could be decoded; if they are "
            "compressed one by one, convert the bag with `ros2 bag convert`"
        )
    return RecordingError(
        f"got no readable samples{where} (topic 'samples', {TYPE}); map foreign topics by `columns`, e.g. "
        "voltage=/ao.data displacement=/sensor.data"
    )


def _write_records(bag: BagWriter, experiment: Experiment) -> None:
    """The messages of all records; see `Rosbag2.write`."""
    bag.add_topic("/samples", TYPE)
    bag.add_topic("/phase", STRING, depth=1, transient_local=True)
    clock_ns, index, end = 1_000_000_000, 0, experiment[0].start_time
    for number, record in enumerate(experiment, 1):
        silent = max(0, round((record.start_time - end) / record.sample_period))
        if record.continues:
            silent = max(silent, int(record.truncated))  # the missing samples show that its state is unknown
            if silent > _LONGEST_SILENCE:
                reason = f"begins {silent} samples after the end of the one before it, expected fewer than 2³¹"
                raise RecordingError(f"record {number}: {reason}; write csv or npz")
            index += silent
        else:
            silent, index = max(0, silent - (not record.truncated)), 0  # the idle sample takes one
        clock_ns += round(silent * record.sample_period * 1e9)
        if not record.continues and not record.truncated:
            bag.write("/phase", clock_ns, PhaseNames.to_cdr(0, IDLE))
            settled = replace(record[:1], voltage=np.array([record.settled_voltage]))
            clock_ns, index = _write_blocks(bag, settled, 0, clock_ns, index)
        bag.write("/phase", clock_ns, PhaseNames.to_cdr(number, record.phase))
        is_held = record.continues and not record.truncated and silent > 0
        clock_ns, index = _write_blocks(bag, record, number, clock_ns, index, follows_pause=is_held)
        end = record.start_time + record.duration


def _write_blocks(
    bag: BagWriter, record: Record, number: int, clock_ns: int, index: int, *, follows_pause: bool = False
) -> tuple[int, int]:
    """Write one record; return the time and the index after it."""
    longest = max(2, round(_BLOCK_DURATION / record.sample_period))  # a single sample has no period
    channels = {"voltage": record.voltage, "displacement": record.displacement, **record.channels}
    for a in range(0, record.size, longest):
        part = slice(a, a + longest)
        n = record.voltage[part].size
        block = BlockMessage(
            clock_ns,
            {name: values[part] for name, values in channels.items()},
            np.full(n, number, np.uint32),
            np.asarray(np.arange(n) * record.sample_period),
            (index + a + np.arange(n)).astype(np.uint32),
            follows_pause and a == 0,
        )
        bag.write("/samples", clock_ns, block.to_cdr())
        clock_ns += round(n * record.sample_period * 1e9)
    return clock_ns, index + record.size
