"""Read an experiment, whatever its format, and say what is in it: `python read_experiment.py PATH`."""

import sys

from piezo_hysteresis import read

experiment = read(sys.argv[1])
for record in experiment:
    volts, micrometres = record.voltage, record.displacement * 1e6
    print(
        f"{record.phase:14} {record.size:8} samples of {record.sample_period * 1e6:g} µs, "
        f"{volts.min():.2f} to {volts.max():.2f} V, {micrometres.min():.3f} to {micrometres.max():.3f} µm"
    )
for notice in experiment.notices:
    print(f"{notice.kind} {notice.phase}: {notice.message}")
