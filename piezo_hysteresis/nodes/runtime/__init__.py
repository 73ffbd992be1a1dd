"""What every node process needs: parameters, quality of service, executor, start and end."""
