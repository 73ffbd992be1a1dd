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

"""`cluster`: Dask workers on this machine, or the workers of another scheduler, with compiled kernels."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ..effects import BASELINE, CATALOGUE, HYSTERESIS, Arx, Offset
from ..errors import RecordingError
from ..model.model import Model
from ..record import Record
from .extra import package

PERIOD = 2e-5
"""Sample period of the signals with which the kernels are loaded [s]."""
BEAT = 5.0
"""Time between two reports of a worker to the scheduler [s]."""


def warm_up() -> None:
    """Load the compiled kernels into this process, and limit every library to one thread."""
    threadpool_limits(limits=1)
    drive = 3.0 + np.sin(np.arange(64.0))
    base = Model((HYSTERESIS(), Arx(a=(-1.6, 0.8), b=(0.1, 0.1), delay=3), Offset()), PERIOD)
    for model in [base, *(base.with_effect(effect()) for effect in CATALOGUE if effect not in BASELINE)]:
        record = Record(drive, drive, PERIOD)
        model.simulate(record)
        model.sensitivities(record, list(model.values()))


@cache
def _plugin() -> type:
    base = package("distributed").WorkerPlugin

    class WarmUp(base):  # type: ignore[misc, valid-type]
        """Runs `warm_up` in every worker when it starts, and when it is started again."""

        name = "piezo_fleet_warm_up"

        def setup(self, worker: Any) -> None:
            warm_up()
            _beat_slowly(worker)

    return WarmUp


def _beat_slowly(worker: Any) -> None:
    """Let a worker report to the scheduler every `BEAT` seconds.

    By default a worker sends two reports a second, which take 3 ms of processor time. Fewer are enough: the scheduler
    notices the end of a worker at once, because the connection closes, and a silent worker after five minutes.
    """
    callbacks = worker.periodic_callbacks
    asked = callbacks["heartbeat"]

    async def beat() -> None:
        await worker.heartbeat()
        callbacks["heartbeat"].callback_time = 1e3 * BEAT  # [ms]; the answer of the scheduler changes it

    callbacks["heartbeat"] = type(asked)(beat, asked.callback_time)
    if asked.is_running():
        asked.stop()
        callbacks["heartbeat"].start()


@contextmanager
def cluster(scheduler: str | None = None, workers: int | None = None) -> Iterator[Any]:
    """A Dask client whose workers have loaded the kernels.

    Parameters
    ----------
    scheduler : str, optional
        Address, e.g. ``"tcp://lab-server:8786"``. By default, workers start on this machine and end with the block.
    workers : int, optional
        Number of processes on this machine; default: one per available processor.

    Raises
    ------
    RecordingError
        If Dask is not installed, or the scheduler does not answer.
    """
    distributed, dask = package("distributed"), package("dask")
    settings = {
        "distributed.scheduler.allowed-failures": 0,  # `dispatch` decides
        # by default every nanny, every worker and the scheduler check their event loop 50 times a second, which takes
        # 15 % of a core with eight workers, also if they are idle
        "distributed.admin.tick.interval": "10s",
        "distributed.admin.tick.cycle": "10s",
        "distributed.admin.tick.limit": "20s",  # must exceed the interval, or each check reports a blocked event loop
        "distributed.admin.system-monitor.interval": "5s",
        "distributed.worker.memory.monitor-interval": "2s",
        "distributed.scheduler.active-memory-manager.start": False,  # every result is one row
        "distributed.deploy.lost-worker-timeout": "120s",  # on a busy machine, the restart of a worker takes long
        "distributed.worker.profile.enabled": False,  # the profiler samples the stack a hundred times a second
        # with this variable, each step of a fit returns its memory to the system: twice the processor time
        "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
    }
    with dask.config.set(settings):
        if scheduler is None:
            count = workers or len(os.sched_getaffinity(0))
            host = distributed.LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
        else:
            host = None
        try:
            try:
                client = distributed.Client(host if host is not None else scheduler, timeout=30)
            except (OSError, ValueError, TimeoutError) as error:
                raise RecordingError(
                    f"{scheduler}: {str(error).splitlines()[0]}; expected the address of a Dask scheduler"
                ) from None
            with client:
                client.register_plugin(_plugin()())
                yield client
        finally:
            if host is not None:
                with suppress(TimeoutError):  # a killed worker that ends slowly must not make a finished run fail
                    host.close()


def revive(client: Any) -> None:
    """Start new workers for those on this machine that were killed during their start; Dask does not replace these.

    Parameters
    ----------
    client : distributed.Client
        Client from `cluster`; with another scheduler, nothing is done.
    """
    host = client.cluster
    if host is None:
        return

    def forget_ended() -> None:
        for name in [name for name, nanny in host.workers.items() if nanny.status.name in ("closed", "failed")]:
            del host.workers[name]

    host.loop.add_callback(forget_ended)
    host.scale(len(host.worker_spec))
