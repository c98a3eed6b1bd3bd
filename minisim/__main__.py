"""The `minisim` command, also as `python -m minisim`."""

import os
import sys

# After `python -m` the working directory comes first, and a numpy.py there would hide the real one.
# The variable does the same in worker processes.
if __name__ == "__main__" and not sys.flags.safe_path:
    sys.path.append(sys.path.pop(0))
os.environ["PYTHONSAFEPATH"] = "1"

import signal

# Until `main` handles Ctrl-C, it ends the process without a traceback.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from scenarios.cli import main

if __name__ == "__main__":
    sys.exit(main())
