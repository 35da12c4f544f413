"""An adapter module that ends its process while it is imported."""

import os
import sys

if "pytest" not in sys.modules:
    os._exit(3)
