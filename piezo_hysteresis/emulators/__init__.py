"""Controllers without hardware, for tests and rehearsals; the runtime never imports them."""
