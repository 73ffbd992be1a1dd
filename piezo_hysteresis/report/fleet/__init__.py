"""The page about many recordings: parameters over time, outlying stages, where the model class fails."""
