"""A stage identified through the controller is the stage identified directly."""

import numpy as np

from piezo_hysteresis.identification import DriveLimits, excitation, identify
from piezo_hysteresis.identification.normal_equations import Nuisance, residuals
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.stage.simulated import SimulatedStage

SERVO_TIME = 50e-6


def phases():
    limits = DriveLimits(sample_period=SERVO_TIME)
    bodies = {
        "step": excitation.steps(limits, (0.2, 0.6, 0.3, 0.8) * 3, 0.01),
        "noise": excitation.noise(limits, 0.03, 5e3, 0.15, 0.35, 1),
        "triangle": excitation.triangle(limits, (1.0, 0.5), 10.0),
        "validation": excitation.mixture(limits, 0.15, 9),
    }
    return {name: limits.from_safe_to_safe(body) for name, body in bodies.items()}


def test_two_models_that_differ_by_less_than_the_noise(bench, play):
    stage = bench(seed=5, points_per_command=500).stage
    through, direct = [], []
    simulated = SimulatedStage(seed=8, sample_period=SERVO_TIME)
    for name, drive in phases().items():
        got = play(stage, drive)
        assert drive.size <= stage.description.longest_block
        first = not through
        through.append(Record(got.voltage, got.displacement, SERVO_TIME, name, continues=not first))
        direct.append(simulated.play(drive, name, continues=not first))
    models = [identify(Experiment(tuple(r)), gain=0.24641, orders=(3, 3)) for r in (through, direct)]
    left = [residuals(m.model, direct, Nuisance(offset=True))[-1] for m in models]
    noise = simulated.parameters.sensor.noise * simulated.parameters.full_stroke
    assert np.std(left[1]) < 1.5 * noise
    assert np.std(left[0] - left[1]) < 0.5 * noise, "the two models predict the same"
    assert models[0].delay.samples == models[1].delay.samples
