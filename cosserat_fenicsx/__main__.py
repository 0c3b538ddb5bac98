"""`cosserat`, and `python -m cosserat_fenicsx`: the command line, which answers to signals from the first moment on."""

import contextlib
import os
import sys


def main():
    """Entry point; returns the exit code, see `cli.main`."""
    try:
        from cosserat_fenicsx import interrupts, ranks

        interrupts.listen()
        from cosserat_fenicsx.cli.main import main as whole

        code = whole()
        ranks.leave()  # ranks that come here have the same code
        interrupts.ignore()
    except KeyboardInterrupt:  # while modules are imported
        known = sys.modules.get("cosserat_fenicsx.interrupts")
        if not (known and known.asked()):  # else it was said at the signal
            sys.stderr.write("cosserat: interrupted\n")
        code = 130
    if code == 130:  # at once: Python would end by SIGINT itself where that came during an import in C
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError):  # the terminal may be gone
                stream.flush()
        os._exit(code)
    return code


if __name__ == "__main__":
    sys.exit(main())
