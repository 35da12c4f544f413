"""`python -m pytest_simbench`: the command `simbench`."""

from __future__ import annotations

import sys

from pytest_simbench.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
