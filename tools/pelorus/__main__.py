# SPDX-License-Identifier: MIT
"""`python -m pelorus` is the command `pelorus`."""

import sys

from pelorus.cli import main

sys.exit(main())
