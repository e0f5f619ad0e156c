"""``python -m heatwalk``: the same as the command ``heatwalk``."""

import sys

from heatwalk.cli import main

if __name__ == "__main__":
    sys.exit(main())
