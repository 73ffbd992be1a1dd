"""The steps of the published method and what replaces them where data are missing."""
