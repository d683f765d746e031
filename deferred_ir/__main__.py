"""`python -m deferred_ir` is `deferred-ir`."""

import sys

from deferred_ir.cli.main import main

sys.exit(main())
