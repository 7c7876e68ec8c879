"""What this documentation adds to Sphinx: a file for each."""
