"""Does identification find what is there, and does it know how well? Repeats on synthetic logs with realistic noise."""
