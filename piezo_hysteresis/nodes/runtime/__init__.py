"""What every node process needs: parameters, quality of service, executor, life of the process."""
