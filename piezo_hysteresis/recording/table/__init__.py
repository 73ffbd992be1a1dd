"""Tables of numbers: columns, titles, units and the time base."""
