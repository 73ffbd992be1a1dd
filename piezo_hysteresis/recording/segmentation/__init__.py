"""Phases of a record: where the drive rests, steps and moves; long records shortened on reading."""
