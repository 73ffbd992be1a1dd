"""Changed parameters of a given model: the same stage with, for example, a longer delay or another gain."""
