"""`Server`: an emulated card behind the calls of NI's gRPC device server."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from ....errors import StageError
from .card import Card, CardError

_ANALOG_INPUT, _ANALOG_OUTPUT, _VOLTAGE = 10100, 10102, 10322
_KIND_OF_CHANNEL = 0x187F
_GROUP_BY_CHANNEL = 0
_VERSION = {0x1272: 26, 0x1923: 0, 0x2F22: 0}
_NAME_OF_TASK, _CHANNELS_OF_TASK = 0x1276, 0x1273


@dataclass(slots=True)
class Task:
    """What was told to a task."""

    kind: int = 0
    channels: list[str] = field(default_factory=list)
    rate: float = 0.0
    pending: list[float] = field(default_factory=list)


class Server:
    """Serves the calls that clocked analogue output and input need; every other one is unimplemented, and says so.

    Parameters
    ----------
    card : Card
    host : str
        Address to listen at.
    port : int
        TCP port; 31763 is that of NI's examples, 0 is any free one.

    Raises
    ------
    StageError
        If the package ``nidaqmx[grpc]`` is not installed, or the port cannot be had.
    """

    def __init__(self, card: Card, host: str = "127.0.0.1", port: int = 0) -> None:
        try:
            import grpc
            from nidaqmx._stubs import nidaqmx_pb2, nidaqmx_pb2_grpc
        except ImportError:
            raise StageError(
                "NI emulator: the package nidaqmx is not installed, expected it; pip install 'nidaqmx[grpc]'"
            ) from None
        self._card, self._messages, self._grpc = card, nidaqmx_pb2, grpc
        self._tasks: dict[str, Task] = {}
        self._turn = threading.Lock()
        service = type("Service", (nidaqmx_pb2_grpc.NiDAQmxServicer,), self._calls())
        unlimited = [("grpc.max_receive_message_length", -1), ("grpc.max_send_message_length", -1)]
        self._server = grpc.server(ThreadPoolExecutor(4), options=[*unlimited, ("grpc.so_reuseport", 0)])
        nidaqmx_pb2_grpc.add_NiDAQmxServicer_to_server(service(), self._server)
        try:
            self.port = int(self._server.add_insecure_port(f"{host}:{port}"))
        except RuntimeError:
            raise StageError(f"NI emulator: cannot listen at {host}:{port}; name another port") from None
        self.host = host

    def __enter__(self) -> Self:
        self._server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the port and every link."""
        self._server.stop(None).wait()

    def _calls(self) -> dict[str, Any]:
        names = {name: getattr(self, name) for name in dir(self) if name[0].isupper()}
        return {name: self._answering(name, call) for name, call in names.items()}

    def _answering(self, name: str, call: Any) -> Any:
        def answer(_: object, request: Any, context: Any) -> Any:
            try:
                with self._turn:
                    values = call(request)
            except CardError as error:
                context.set_trailing_metadata((("ni-error", str(error.number)),))
                context.abort(self._grpc.StatusCode.UNKNOWN, str(error))
            except ConnectionError:
                context.abort(self._grpc.StatusCode.UNAVAILABLE, "the fault that was asked for")
            return getattr(self._messages, f"{name}Response")(**values)

        return answer

    # calls of NI's interface, by their names there

    def CreateTask(self, request: Any) -> dict[str, Any]:
        name = f"task{len(self._tasks) + 1}"
        self._tasks[name] = Task()
        return {"task": {"name": name}, "new_session_initialized": True}

    def ClearTask(self, request: Any) -> dict[str, Any]:
        task = self._tasks.get(request.task.name, Task())
        if task.kind == _ANALOG_OUTPUT and task.rate:
            self._card.stop()
        task.kind, task.rate = 0, 0.0
        return {}

    def CreateAOVoltageChan(self, request: Any) -> dict[str, Any]:
        return self._add(request, _ANALOG_OUTPUT)

    def CreateAIVoltageChan(self, request: Any) -> dict[str, Any]:
        return self._add(request, _ANALOG_INPUT)

    def CfgSampClkTiming(self, request: Any) -> dict[str, Any]:
        self._task(request).rate = request.rate
        return {}

    def SetWriteAttributeInt32(self, request: Any) -> dict[str, Any]:
        return {}

    def StartTask(self, request: Any) -> dict[str, Any]:
        task = self._task(request)
        if task.kind == _ANALOG_OUTPUT:
            self._card.start(task.rate)
        return {}

    def StopTask(self, request: Any) -> dict[str, Any]:
        if self._task(request).kind == _ANALOG_OUTPUT:
            self._card.stop()
        return {}

    def WriteAnalogF64(self, request: Any) -> dict[str, Any]:
        values = np.array(request.write_array)
        if self._task(request).rate:
            self._card.write(values)
        else:
            self._card.set(float(values[-1]))
        return {"samps_per_chan_written": request.num_samps_per_chan}

    def WriteAnalogScalarF64(self, request: Any) -> dict[str, Any]:
        self._card.set(request.value)
        return {}

    def ReadAnalogF64(self, request: Any) -> dict[str, Any]:
        task = self._task(request)
        if task.rate:
            values = self._card.read(task.channels, request.num_samps_per_chan, request.timeout)
        else:
            values = self._card.look(task.channels)[:, None]
        count = values.shape[1]
        if request.fill_mode_raw != _GROUP_BY_CHANNEL:
            values = values.T
        padded = np.zeros(max(request.array_size_in_samps, values.size))
        padded[: values.size] = values.ravel()
        return {"read_array": padded, "samps_per_chan_read": count}

    def ReadAnalogScalarF64(self, request: Any) -> dict[str, Any]:
        return {"value": float(self._card.look(self._task(request).channels)[0])}

    def GetSystemInfoAttributeUInt32(self, request: Any) -> dict[str, Any]:
        return {"value": _VERSION.get(request.attribute_raw, 0)}

    def GetTaskAttributeString(self, request: Any) -> dict[str, Any]:
        told = {_NAME_OF_TASK: request.task.name, _CHANNELS_OF_TASK: self._listed(request)}
        return {"value": told.get(request.attribute_raw, "")}

    def GetTaskAttributeUInt32(self, request: Any) -> dict[str, Any]:
        return {"value": len(self._task(request).channels)}

    def GetReadAttributeString(self, request: Any) -> dict[str, Any]:
        return {"value": self._listed(request)}

    def GetReadAttributeUInt32(self, request: Any) -> dict[str, Any]:
        return {"value": len(self._task(request).channels)}

    def GetChanAttributeInt32(self, request: Any) -> dict[str, Any]:
        return {"value_raw": self._task(request).kind if request.attribute_raw == _KIND_OF_CHANNEL else _VOLTAGE}

    def _task(self, request: Any) -> Task:
        return self._tasks[request.task.name]

    def _listed(self, request: Any) -> str:
        return ", ".join(self._task(request).channels)

    def _add(self, request: Any, kind: int) -> dict[str, Any]:
        channel = request.physical_channel.partition("/")[2]
        if channel not in ("ao0", "ai0", "ai1", "ai2"):
            raise CardError(-200170, f"Physical channel specified does not exist on this device: {channel}")
        task = self._task(request)
        task.kind = kind
        task.channels.append(channel)
        return {}
