"""``python -m bha``: the command ``bha``."""

from bha.cli import main

if __name__ == "__main__":
    main(prog_name="bha")
