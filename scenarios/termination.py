"""SIGTERM as an exception, so that a process cleans up before it ends; and no signal is lost."""

from __future__ import annotations

import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, NoReturn


class Terminated(BaseException):
    """SIGTERM came. No `SystemExit`, which an error of a caller's code may be (`sys.exit`)."""

    code = 128 + signal.SIGTERM  #: what a shell reports after that signal


#: How soon a signal comes again [s].
AGAIN = 0.01

_SIGNALS = {KeyboardInterrupt: signal.SIGINT, Terminated: signal.SIGTERM}


@contextmanager
def terminable() -> Iterator[None]:
    """Raise `Terminated` on SIGTERM in the block, and let neither it nor Ctrl-C be lost.

    Python calls some functions from C, such as one after each import, and drops what they raise. If
    that is the exception of a signal, the signal comes again.

    Outside the main thread, or where SIGTERM is already handled or ignored, it does nothing.
    """
    before, hook = signal.getsignal(signal.SIGTERM), sys.unraisablehook
    if threading.current_thread() is not threading.main_thread() or before != signal.SIG_DFL:
        yield
        return

    def again(dropped: Any) -> None:
        if dropped.exc_type not in _SIGNALS:
            hook(dropped)
            return
        # From a thread, since here the exception would be dropped, too.
        timer = threading.Timer(AGAIN, _signal_main, (_SIGNALS[dropped.exc_type],))
        timer.daemon = True
        timer.start()

    sys.unraisablehook = again
    signal.signal(signal.SIGTERM, _raise_terminated)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
        sys.unraisablehook = hook


def _signal_main(number: signal.Signals) -> None:
    main = threading.main_thread().ident
    if main is not None and hasattr(signal, "pthread_kill"):
        signal.pthread_kill(main, number)
    else:  # Windows
        interrupt_main(number)


def _raise_terminated(_number: int, _frame: FrameType | None) -> NoReturn:
    raise Terminated
