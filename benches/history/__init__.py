"""What benchmarks measured, kept: one JSON file for a commit and a machine, and ratios that outlive the machine."""
