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

"""NI's own client, unmodified and used as its examples use it, talks to the emulated card."""

import nidaqmx
import numpy as np
import pytest
from nidaqmx.constants import AcquisitionType, RegenerationMode

from piezo_hysteresis.stage.simulated import SimulatedStage

grpc = pytest.importorskip("grpc")
TS = 20e-6


@pytest.fixture
def task(rig, ideal):
    """Make tasks on an emulated card, as a script does."""
    made = rig(plant=ideal(), opened=False)
    channel = grpc.insecure_channel(f"127.0.0.1:{made.server.port}", options=[("grpc.max_receive_message_length", -1)])
    tasks = []

    def make():
        tasks.append(nidaqmx.Task(grpc_options=nidaqmx.GrpcSessionOptions(channel, "")))
        return tasks[-1]

    yield make
    for each in tasks:
        each.close()
    channel.close()


def test_a_second_of_output_and_two_inputs_on_one_clock(task, ideal):
    output, inputs = task(), task()
    wave = 3.0 - 3.0 * np.cos(2 * np.pi * 5 * TS * np.arange(50_000))
    output.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=0, max_val=10)
    inputs.ai_channels.add_ai_voltage_chan("Dev1/ai0")
    inputs.ai_channels.add_ai_voltage_chan("Dev1/ai1")
    for each, source in ((output, ""), (inputs, "/Dev1/ao/SampleClock")):
        each.timing.cfg_samp_clk_timing(1 / TS, source, sample_mode=AcquisitionType.FINITE, samps_per_chan=wave.size)
    assert output.timing.samp_clk_rate == pytest.approx(50e3)
    assert output.write(wave) == wave.size
    inputs.start()
    output.start()
    inputs.wait_until_done(10.0)
    assert output.is_task_done()
    displacement, monitor = np.array(inputs.read(wave.size))
    expected = SimulatedStage(ideal(), sample_period=TS).play(wave, initial_voltage=0.0)
    np.testing.assert_allclose(6e-6 * displacement, expected.displacement, rtol=1e-7, atol=1e-13)
    np.testing.assert_allclose(monitor / 2.0, wave, atol=1e-9)


def test_a_continuous_output_without_regeneration_ends_without_new_samples(task):
    output = task()
    output.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=0, max_val=10)
    output.timing.cfg_samp_clk_timing(1 / TS, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=1000)
    output.write(np.zeros(1000))
    with pytest.raises(nidaqmx.errors.DaqError, match=r"[Rr]egeneration"):
        output.start()
    output.out_stream.regen_mode = RegenerationMode.DONT_ALLOW_REGENERATION
    output.start()


def test_single_values_and_refused_calls(task):
    output, inputs = task(), task()
    output.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=0, max_val=10)
    inputs.ai_channels.add_ai_voltage_chan("Dev1/ai1")
    output.write(4.0)
    assert inputs.read() == pytest.approx(8.0)
    with pytest.raises(nidaqmx.errors.DaqError) as refused:
        output.write(11.0)
    assert refused.value.error_code == -200077
    with pytest.raises(nidaqmx.errors.DaqError) as refused:
        inputs.ai_channels.add_ai_voltage_chan("Dev1/ai7")
    assert refused.value.error_code == -200170
    with pytest.raises(nidaqmx.errors.RpcError, match="not supported"):
        inputs.ci_channels.add_ci_count_edges_chan("Dev1/ctr0")
