"""Emulated controllers for tests and rehearsals; the runtime never imports them."""
