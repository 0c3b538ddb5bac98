"""The command line of a demo that keeps what is done when it is broken off."""

import argparse
import sys


def command(main, about, quick):
    """Run `main(quick=, fresh=, out=)` as the command line says.

    Args:
        main: goes on from what an earlier run has left in `out`, unless it is to be `fresh`.
        about: the demo's docstring; quick: what its quick mode is.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--fresh", action="store_true", help="continue no earlier run")
    parser.add_argument("-o", "--out", default="out", help="folder for what is written (default: out)")
    try:
        main(**vars(parser.parse_args()))
    except KeyboardInterrupt:
        print("\nbroken off; what is done is kept, and the same command goes on from there", file=sys.stderr)
        sys.exit(130)
