"""What all tests need of the process that runs them."""

import signal

# A job that a shell starts in the background ignores SIGINT, and so would the programs that tests
# start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
