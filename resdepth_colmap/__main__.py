"""`python -m resdepth_colmap` is the command `resdepth-colmap`."""

from resdepth_colmap.cli.main import main

if __name__ == "__main__":
    main()
