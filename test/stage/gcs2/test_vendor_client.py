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

"""PI's own client, unmodified, talks to the emulated controller."""

import math
import time

import numpy as np
import pytest

pytest.importorskip("pipython", reason="pipython is not installed: pip install pipython==2.11.0.6")

from pipython import GCSError, datarectools, gcserror, pitools
from pipython.pidevice.gcs2.gcs2device import GCS2Device
from pipython.pidevice.interfaces.pisocket import PISocket


@pytest.fixture
def pi(bench, ideal):
    made = bench(plant=ideal(), opened=False)
    device = GCS2Device(gateway=PISocket(made.server.host, made.server.port))
    yield device
    device.close()


def read(device, header):
    while device.bufstate is not True:
        time.sleep(1e-3)
    return header, np.array(device.bufdata)


def test_it_finds_a_controller_and_what_it_can_do(pi):
    assert pi.devname == "E-727.EMULATED"
    assert pi.axes == pi.allaxes == ["1"]
    assert pi.IsControllerReady()
    for name in ("SVA", "qVOL", "WCL", "WGO", "DRC", "qDRR", "IsGeneratorRunning", "StopAll"):
        assert getattr(pi, f"Has{name}")(), name
    assert datarectools.getservotime(pi, usepreset=False) == 50e-6
    assert pi.qSPA("1", 0x16000200)["1"][0x16000200] == 262144
    assert (pi.qVMI(1)[1], pi.qVMA(1)[1], pi.qTNR()) == (0.0, 200.0, 8)


def test_open_loop_and_its_refusal_under_servo(pi):
    pi.SVO("1", False)
    pi.SVA("1", 40.0)
    assert pi.qSVA("1")["1"] == pytest.approx(40.0)
    assert pi.qVOL(1)[1] == pytest.approx(40.0)
    with pytest.raises(GCSError) as refused:
        pi.SVA("1", 201.0)
    assert refused.value == gcserror.E66_PI_CNTR_VOL_OUT_OF_LIMITS
    pi.SVO("1", True)
    with pytest.raises(GCSError) as refused:
        pi.SVA("1", 1.0)
    assert refused.value == gcserror.E79_PI_CNTR_OPENLOOP_VALUE_SET_WHEN_SERVO_ON
    with pytest.raises(GCSError) as refused:
        pi.SVO("2", True)
    assert refused.value == gcserror.E23_PI_CNTR_ILLEGAL_AXIS


def test_wave_and_record(pi):
    wave = [40.0 - 40.0 * math.cos(0.1 * i) for i in range(126)]
    pitools.writewavepoints(pi, 1, wave, bunchsize=10)
    _, stored = read(pi, pi.qGWD(1, 1, len(wave)))
    np.testing.assert_allclose(stored[0], wave, atol=1e-6)
    pi.WSL(1, 1)
    pi.WGC(1, 1)
    pi.WTR(1, 2, 0)
    pi.RTR(2)
    pi.DRC([1, 2], ["1", "1"], [7, 2])
    assert pi.qDRC([1, 2]) == {1: ["1", 7], 2: ["1", 2]}
    pi.WGO(1, 1)
    pitools.waitonwavegen(pi, 1, polldelay=1e-3)
    assert pi.qDRL([1, 2]) == {1: len(wave), 2: len(wave)}
    header, (voltage, position) = read(pi, pi.qDRR([1, 2], 1, len(wave)))
    assert float(header["SAMPLE_TIME"]) == pytest.approx(100e-6)
    assert (header["DIM"], header["NDATA"]) == (2, len(wave))
    np.testing.assert_allclose(voltage, wave, atol=1e-5)
    assert position[31] > position[0] + 10.0, "µm"


def test_stop_all(pi):
    pi.StopAll(noraise=True)
    assert pi.qERR() == 0
