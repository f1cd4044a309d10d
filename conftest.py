"""What all tests share: programs that they start can be interrupted."""

import signal

# A shell starts its background jobs with SIGINT ignored, and the programs that the tests start
# and interrupt would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
