"""The identification node: plays a protocol, records it, fits a model and serves it."""
