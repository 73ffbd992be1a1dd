"""Experiments on the independent plant: the rich protocol of slow and fast phases, and the paper's poor one."""

from __future__ import annotations

import numpy as np
from independent_plant import NATIVE, Plant

from piezo_hysteresis.record import Experiment


def triangle(peaks, dt, frequency=1.0, base=0.0):
    """Triangles of one period each, from `base` to every peak [V]."""
    corners = [base]
    for peak in peaks:
        corners += [peak, base]
    times = np.arange(len(corners)) / (2 * frequency)
    return np.interp(np.arange(0, times[-1], dt), times, corners)


def noise(rms, duration, rng, centre=3.5):
    """Band-limited noise up to 8 kHz around `centre` [V]."""
    n = int(duration / NATIVE)
    spectrum = rng.normal(size=n // 2 + 1) + 1j * rng.normal(size=n // 2 + 1)
    spectrum[np.fft.rfftfreq(n, NATIVE) > 8e3] = 0
    x = np.fft.irfft(spectrum, n)
    return centre + rms * x / x.std()


def multisine(rms, rng, centre=3.5, f0=20.0, top=1500.0, periods=3):
    """Odd multisine with random phases."""
    t = np.arange(0, periods / f0, NATIVE)
    x = sum(np.cos(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi)) for f in np.arange(f0, top, 2 * f0))
    return centre + rms * x / x.std()


def ladder(levels, hold, rate, dt):
    """Staircase with holds [s], ramps at `rate` [V/s]."""
    times, values = [0.0], [levels[0]]
    for before, after in zip(levels, levels[1:]):
        times += [times[-1] + hold, times[-1] + hold + abs(after - before) / rate]
        values += [before, after]
    times.append(times[-1] + hold)
    values.append(values[-1])
    return np.interp(np.arange(0, times[-1], dt), times, values)


def rich(plant: Plant, seed: int, short: bool = False) -> Experiment:
    """Step, noise at two levels, triangles, sines, multisines, trapezoids, staircase, minor loops, rests, triangle."""
    rng = np.random.default_rng(seed)
    records, clock = [], 0.0

    def add(phase, u, dt=NATIVE, averaged=1, settled=None):
        nonlocal clock
        records.append(plant.play(u, dt, phase, rng, clock, settled, averaged))
        clock += u.size * dt + 0.5

    def sine(f, dt, periods, amplitude=2.5):
        return 3.5 + amplitude * np.sin(2 * np.pi * f * np.arange(0, periods / f, dt))

    add("rest", np.zeros(2000), 1e-3)
    for _ in range(2):
        step = np.repeat([1.0, 4.0, 1.0, 4.0], 500)
        add("step", step)
    for rms in (0.12, 0.12, 0.03, 0.03):
        add("noise", noise(rms, 0.25, rng))
    add("triangle", triangle((8, 6, 4, 2), 1e-4), 1e-4, 10)
    for f in (1, 50, 100, 200, 300, 400):
        slow = f < 5
        add(f"sine_{f}hz", sine(f, 1e-4 if slow else NATIVE, 2 if slow else max(3, f // 20)), 1e-4 if slow else NATIVE, 10 if slow else 1)
    for rms in (1.0, 1.0, 0.2, 0.2):
        add("multisine", multisine(rms, rng))
    add("trapezoid", ladder((1, 7, 1, 7, 1), 0.004, 4e4, NATIVE))
    add("trapezoid", ladder((0.5, 4, 1, 8, 2), 0.004, 2e4, NATIVE))
    add("staircase", ladder((0, 2, 4, 6, 8, 6, 4, 2, 0), 5.0 if short else 10.0, 40.0, 1e-3), 1e-3, 10)
    add("minor_loops", triangle((8, 2), 1e-4)[:: 1], 1e-4, 10)
    nested = np.interp(np.arange(0, 4, 1e-4), np.linspace(0, 4, 11), [0, 8, 2, 6, 3, 5, 3.5, 6, 2, 8, 0])
    add("minor_loops", nested, 1e-4, 10)
    decaying = np.interp(np.arange(0, 4, 1e-4), np.linspace(0, 4, 11), [0, 8, 1, 7, 2, 6, 3, 5, 3.5, 4.5, 4])
    add("minor_loops", decaying, 1e-4, 10)
    add("rest", np.full(2000, 0.0), 1e-3)
    add("rest", np.full(2000, 6.0), 1e-3)
    add("triangle", triangle((8, 6, 4, 2), 1e-4), 1e-4, 10)
    return Experiment(tuple(records), source="independent plant")


def poor(plant: Plant, seed: int) -> Experiment:
    """What the paper records: a step, noise, a triangle, and sines."""
    whole = rich(plant, seed, short=True)
    keep = [r for r in whole if r.phase in ("step", "noise", "triangle") or r.phase.startswith("sine")]
    return Experiment(tuple(keep[:1] + keep[2:3] + keep[6:]), source="independent plant, poor protocol")
