"""What is played to a stage: waveforms, limits, phases."""
