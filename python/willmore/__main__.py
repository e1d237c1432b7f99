"""The program, as ``python -m willmore``."""

from ._program import main

if __name__ == "__main__":
    main()
