# SPDX-License-Identifier: MIT
"""`python -m pelorus` is the command `pelorus`."""

import sys

from pelorus.commands.cli import main

sys.exit(main())
