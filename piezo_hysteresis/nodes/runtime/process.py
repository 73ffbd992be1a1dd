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

"""`run` and `run_together`: run node processes from command line to exit code."""

from __future__ import annotations

import gc
import signal
import socket
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from ...acquisition.safety.console import Console
from ...errors import PiezoError
from .executor import make_executor, spin_until
from .guarded_node import GuardedNode
from .interrupt import was_interrupted

_BAD_START = (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    PiezoError,
    rclpy_implementation.RCLError,
    rclpy_implementation.UnknownROSArgsError,
)
"""Exceptions that rclpy raises on wrong parameters or arguments."""

AnyNode = TypeVar("AnyNode", bound=GuardedNode)


@dataclass(frozen=True, slots=True)
class NodeLife(Generic[AnyNode]):
    """How a node of a process begins and ends.

    Parameters
    ----------
    make : callable
        Makes the node. It must not move the stage yet, because a signal ends it at once.
    begin : callable
        Called once, before the node spins.
    end : callable
        Called once, after it has stopped spinning for any reason, or when a later node could not be made.
    """

    make: Callable[[], AnyNode]
    begin: Callable[[AnyNode], None] = lambda node: None
    end: Callable[[AnyNode], None] = lambda node: None


def run(
    make: Callable[[], AnyNode],
    arguments: Sequence[str] | None = None,
    *,
    begin: Callable[[AnyNode], None] = lambda node: None,
    end: Callable[[AnyNode], None] = lambda node: None,
) -> int:
    """Run one node as `run_together` does."""
    return run_together([NodeLife(make, begin, end)], arguments)


def run_together(lives: Sequence[NodeLife[Any]], arguments: Sequence[str] | None = None) -> int:
    """Make nodes and spin them in one thread until SIGINT, SIGTERM or SIGHUP (the terminal was closed).

    The handlers of rclpy would invalidate the context at once. Here the signals only end the spinning, further signals
    are ignored, and `end` can still publish and serve. An exception of a callback is reported, and the node continues.
    No line that the process writes waits for its terminal.

    Parameters
    ----------
    lives : sequence of NodeLife
        Functions of every node. The nodes begin in this order and end in the opposite order.
    arguments : sequence of str, optional
        Command line; by default that of the process.

    Returns
    -------
    int
        0, 2 where a node could not be made from its parameters (the reason is one line on stderr), or 130 where it
        was interrupted while it was made.
    """
    with Console():
        return _run(lives, arguments)


def _run(lives: Sequence[NodeLife[Any]], arguments: Sequence[str] | None) -> int:
    with ExitStack() as ending:
        ending.callback(rclpy.try_shutdown)
        nodes: list[GuardedNode] = []
        try:
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
            executor = make_executor()
            ending.callback(executor.shutdown)
            for life in lives:
                nodes.append(life.make())
                ending.callback(life.end, nodes[-1])
                executor.add_node(nodes[-1])
            stop = _signalled()
            if was_interrupted():
                raise KeyboardInterrupt
        except KeyboardInterrupt:
            return 128 + signal.SIGINT
        except _BAD_START as error:
            sys.stderr.write(f"{' '.join(str(error).split())}\n")
            return 2
        gc.collect()
        gc.freeze()  # the garbage collector need not walk over the objects of the start while a stream waits
        for node, life in zip(nodes, lives, strict=True):
            life.begin(node)
        spin_until(executor, stop, nodes[0])
    return 0


def _signalled() -> Future:
    """A future that is done when the process receives a signal, also while the executor waits outside Python."""
    stop = Future()
    ours, theirs = socket.socketpair()
    theirs.setblocking(False)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:  # nohup ignores it on purpose
            signal.signal(number, lambda *_: None)
    signal.set_wakeup_fd(theirs.fileno())

    def wait() -> None:
        while ours.recv(1):
            if not stop.done():
                stop.set_result(theirs)

    threading.Thread(target=wait, name="signals", daemon=True).start()
    return stop
