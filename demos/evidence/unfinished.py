"""The command line of a demo that can be interrupted and continued."""

import argparse
import sys


def command(main, about, quick):
    """Run `main(quick=, fresh=, out=)` with the options of the command line.

    Args:
        main: continues an earlier run from its files in `out`, unless `fresh`.
        about: the demo's docstring; quick: description of its quick mode.
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
