"""Effects that add to the displacement from outside."""
