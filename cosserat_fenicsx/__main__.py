"""`python -m cosserat_fenicsx` is the command line."""

import sys

from cosserat_fenicsx.cli.main import main

sys.exit(main())
