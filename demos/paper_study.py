"""Compute a published study of a gear pair anew and hold it against its claims.

Run it as it stands: python demos/paper_study.py [OUTPUT_FOLDER]
"""

import sys
from pathlib import Path

from gearmon.study import write_study
from gearmon.terminal import progress_bar


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "gearmon-study")
    with progress_bar("study") as progress:
        report = write_study(folder, progress)
    print("\n".join(report.lines()))


if __name__ == "__main__":
    main()
