"""python -m tisoft."""

import sys

from tisoft.cli import main

sys.exit(main())
