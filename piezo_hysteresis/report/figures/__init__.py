"""The figures of the page, one per file."""
