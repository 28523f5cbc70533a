"""`python -m holozen` and `holozen`: the command line."""

import _signal  # type: ignore[import-not-found]

# Until `main` takes over: a Ctrl-C that comes while it loads ends this without a traceback.
if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
    _signal.signal(_signal.SIGINT, _signal.SIG_DFL)

from holozen.cli import main

if __name__ == "__main__":
    main()
