"""What it takes to answer `camcal --help`, beside an empty Python: `python benchmarks/start.py [--runs N]`.

Both run as whole processes in turn; printed are the CPU seconds and the median of the ratios. Ends with exit code 1 if the
limit is missed. How long one small image takes to undistort is a row of undistort.py.
"""

from __future__ import annotations

import argparse
import sys
from statistics import median

from processes import alternating, ratio

LIMIT = 6.0
HELP = "import sys; from camcal.cli import main; sys.exit(main(['--help']))"
"""What the installed script does; `python -m camcal` would add the time of runpy."""


def main() -> None:
    """Run them in turn and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=30, help="runs of each (default: 30)")
    python, click, camcal = alternating(
        [[sys.executable, "-c", code] for code in ("pass", "import click", HELP)], parser.parse_args().runs
    )
    print(f"{'':16}{'CPU s':>8}{'ratio':>8}{'limit':>8}")
    for name, runs in (("python", python), ("import click", click), ("camcal --help", camcal)):
        limit = f"{LIMIT:8g}" if runs is camcal else ""
        print(f"{name:16}{median(run.cpu_s for run in runs):8.4f}{ratio(runs, python, 'cpu_s'):8.2f}{limit}")
    sys.exit(ratio(camcal, python, "cpu_s") > LIMIT)


if __name__ == "__main__":
    main()
