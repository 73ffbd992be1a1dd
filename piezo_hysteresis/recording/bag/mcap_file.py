"""`McapFile`: messages of an MCAP file, read from front to back up to where it is cut or damaged."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import get_chunk_data_stream

from ...errors import RecordingError
from ...record import Notice

MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
_LARGEST_EXPANSION = 1000


class McapFile:
    """One .mcap file.

    Records are framed here, so that a cut or a wrong length costs what is behind it and no memory; what is inside them
    is decoded by the `mcap` package.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notices: list[Notice] = []
        self.definitions: dict[str, str] = {}
        self._channels: dict[int, tuple[str, str]] = {}
        self._schemas: dict[int, str] = {}

    def messages(self) -> Iterator[tuple[str, str, int, bytes]]:
        """Topic, type, time [ns] and bytes of every message.

        Raises
        ------
        RecordingError
            If the file is no MCAP file.
        """
        self.notices.clear()
        size = self.path.stat().st_size
        with self.path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f"{self.path}: got other first bytes than those of an MCAP file")
            damaged = 0
            ended = False
            for opcode, body, whole in _framed(file, size):
                ended = whole and opcode == Opcode.FOOTER
                try:
                    yield from self._opened(opcode, body, whole)
                except Exception:  # decoders and decompressors raise whatever they like on damaged bytes
                    damaged += 1
                if ended:
                    break
            where = file.tell()
        if damaged:
            self.notices.append(Notice("damaged", f"{self.path.name}: {damaged} damaged chunks are skipped"))
        if not ended:
            self.notices.append(
                Notice(
                    "cut", f"{self.path.name} ends without its index after {where} of {size} bytes: read up to there"
                )
            )

    def _opened(self, opcode: int, body: bytes, whole: bool) -> Iterator[tuple[str, str, int, bytes]]:
        if opcode == Opcode.CHUNK:
            chunk = Chunk.read(ReadDataStream(io.BytesIO(body)))
            data = chunk.data
            if whole:
                if chunk.uncompressed_size > _LARGEST_EXPANSION * (len(data) + 1):
                    raise RecordingError("chunk declares more than its bytes can hold")
                stream, length = get_chunk_data_stream(chunk, validate_crc=True)
                data = stream.read(length) if length else b""
            elif chunk.compression:
                return
            inside = list(_framed(io.BytesIO(data), len(data)))
            for opcode, body, whole in inside:
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


def _framed(file: BinaryIO, size: int) -> Iterator[tuple[int, bytes, bool]]:
    """Opcode and body of every record, and whether it is whole; a record that is cut is the last one."""
    while len(head := file.read(_HEAD.size)) == _HEAD.size:
        opcode, length = _HEAD.unpack(head)
        left = size - file.tell()
        yield opcode, file.read(min(length, left)), length <= left
        if length > left:
            return
