"""The waveforms, limits and phases that are played to a stage."""
