"""Common parts of all node processes: parameters, quality of service, executor, start and end."""
