"""Live diagnosis: which phase is played next, how likely every explanation is after it, and when it is enough."""
