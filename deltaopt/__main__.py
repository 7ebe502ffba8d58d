"""python -m deltaopt."""

import sys

from deltaopt.cli import main

sys.exit(main())
