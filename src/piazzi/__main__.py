"""``python -m piazzi`` is the command line."""

import sys

from piazzi.cli.main import main

sys.exit(main())
