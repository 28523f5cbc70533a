"""`python -m holozen`: the command line."""

import sys

from holozen.cli import main

if __name__ == "__main__":
    sys.exit(main())
