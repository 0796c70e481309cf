"""Ctrl-C as in a terminal, also where the parent ignores it: nohup, a job in the background."""

import signal

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
