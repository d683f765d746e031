"""`python -m deferred_ir` is `deferred-ir`."""

import sys

from .cli import main

sys.exit(main())
