"""As where neither the extra `figures` nor `replay` is installed: a plugin of inner runs, and the
command `simbench`.

Whatever a run ends with would else be drawn twice, and the replay's viewer be loaded: as much CPU
time as all the rest of a small run.
"""

from __future__ import annotations

import sys

sys.modules["matplotlib"] = sys.modules["trimesh"] = None  # type: ignore[assignment]

if __name__ == "__main__":
    from pytest_simbench.cli.main import main

    sys.exit(main())
