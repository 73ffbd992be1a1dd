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

"""`McapFile`: reads the messages of an MCAP file up to the place where it is truncated or damaged."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema

from ...errors import RecordingError
from ...record import Notice

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of a file."""

_HEAD = struct.Struct("<BQ")
"""Kind and length of a record."""

_LARGEST_RATIO = 1000
"""Largest number of bytes that one compressed byte of a chunk may contain."""

_IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
"""Kinds of records that a chunk may contain."""

LARGEST_CHUNK = 1 << 26
"""Largest size of an unpacked chunk [byte]."""

LARGEST_EXPANSION = 100
"""Largest ratio of unpacked to stored bytes of a file, after the first `LARGEST_CHUNK`; samples compress to a tenth."""


class McapFile:
    """One .mcap file.

    The record boundaries are read here, so that a truncated record or a wrong length only loses the records after it
    and takes no memory. The `mcap` package decodes the contents.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notices: list[Notice] = []
        self.definitions: dict[str, str] = {}
        self._channels: dict[int, tuple[str, str]] = {}
        self._schemas: dict[int, str] = {}
        self._room = 0

    def messages(self) -> Iterator[tuple[str, str, int, bytes]]:
        """Topic, type, time [ns] and bytes of every message.

        Raises
        ------
        RecordingError
            If the file is no MCAP file.
        """
        self.notices.clear()
        size = self.path.stat().st_size
        self._room = LARGEST_CHUNK + LARGEST_EXPANSION * size
        with self.path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f"{self.path}: got other first bytes than those of an MCAP file")
            damaged = 0
            ended = False
            for opcode, body, whole in _framed(file, size):
                ended = whole and opcode == Opcode.FOOTER
                try:
                    yield from self._opened(opcode, body, whole)
                except Exception:  # decoders and decompressors raise any error on damaged bytes
                    damaged += 1
                if ended:
                    break
            where = file.tell()
        if damaged:
            self.notices.append(Notice("damaged", f"{self.path.name}: {damaged} damaged chunks were skipped"))
        if not ended:
            self.notices.append(
                Notice(
                    "cut",
                    f"{self.path.name} ends without its index after {where} of {size} bytes; the part before was read",
                )
            )

    def _opened(self, opcode: int, body: bytes, whole: bool) -> Iterator[tuple[str, str, int, bytes]]:
        if opcode == Opcode.CHUNK:
            chunk = Chunk.read(ReadDataStream(io.BytesIO(body)))
            data = chunk.data
            if whole:
                self._room -= chunk.uncompressed_size
                declares = chunk.uncompressed_size
                if declares > min(LARGEST_CHUNK, _LARGEST_RATIO * (len(data) + 1)) or self._room < 0:
                    raise RecordingError("chunk declares more than its bytes can hold")
                data = unpacked(chunk)
            elif chunk.compression:
                return
            for opcode, body, whole in _framed(io.BytesIO(data), len(data)):
                if opcode not in _IN_CHUNKS:
                    raise RecordingError(f"chunk holds a record of kind {opcode}, expected schemas, channels, messages")
                if whole:
                    yield from self._record(opcode, body)
        elif whole:
            yield from self._record(opcode, body)

    def _record(self, opcode: int, body: bytes) -> Iterator[tuple[str, str, int, bytes]]:
        stream = ReadDataStream(io.BytesIO(body))
        if opcode == Opcode.MESSAGE:
            message = Message.read(stream, len(body))
            if message.channel_id in self._channels:
                yield *self._channels[message.channel_id], message.log_time, message.data
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[schema.id] = schema.name
            if schema.encoding == "ros2msg":
                self.definitions[schema.name] = schema.data.decode("utf-8", "replace")
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            if channel.message_encoding == "cdr":
                self._channels[channel.id] = (channel.topic, self._schemas.get(channel.schema_id, ""))


def unpacked(chunk: Chunk) -> bytes:
    """The records of a chunk, with at most the number of bytes that it declares.

    Raises
    ------
    RecordingError
        If it unpacks to more or fewer bytes, or to others than it was written with.
    """
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        import zstandard  # only needed for compressed bags, as in the mcap package

        with zstandard.ZstdDecompressor(max_window_size=LARGEST_CHUNK).stream_reader(chunk.data) as stream:
            data = stream.read(size + 1)
    elif chunk.compression == "lz4":
        import lz4.frame

        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif chunk.compression:
        raise RecordingError(f"chunk is compressed by '{chunk.compression}', expected zstd, lz4 or nothing")
    else:
        data = chunk.data
    if len(data) != size or (chunk.uncompressed_crc and chunk.uncompressed_crc != zlib.crc32(data)):
        raise RecordingError(f"chunk has {len(data)} bytes that are not the {size} it was written with")
    return data


def _framed(file: BinaryIO, size: int) -> Iterator[tuple[int, bytes, bool]]:
    """Opcode and body of every record, and whether it is whole; a record that is cut is the last one."""
    while len(head := file.read(_HEAD.size)) == _HEAD.size:
        opcode, length = _HEAD.unpack(head)
        left = size - file.tell()
        if left < 0:  # the file has grown; the new part is read the next time
            return
        yield opcode, file.read(min(length, left)), length <= left
        if length > left:
            return
