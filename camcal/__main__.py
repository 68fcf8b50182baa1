"""`python -m camcal` does what the installed command does."""

from __future__ import annotations

import sys

from camcal.cli import main

sys.exit(main())
