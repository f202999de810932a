"""``python -m mp2a``."""

import sys

from mp2a.cli import main

sys.exit(main())
