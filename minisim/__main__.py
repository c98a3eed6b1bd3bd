"""`python -m minisim`: the `minisim` command."""

import sys

from scenarios.cli import main

sys.exit(main())
