"""The program ``willmore``."""

import sys

from ._willmore import program


def main() -> None:
    """Does as the arguments say, and exits with the code of the program."""
    sys.exit(program(sys.argv[1:]))
