"""`python -m training.sb3`."""

from training.sb3.command import main

if __name__ == "__main__":
    raise SystemExit(main())
