"""What every room needs of the computer and no room of the arm: files, locks, optional packages, its start."""
