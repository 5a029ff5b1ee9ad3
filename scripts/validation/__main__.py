"""Command line of scripts/validate: which checks, their table, target/validation.json, the exit status."""

import argparse
import json
import sys
import traceback

from checks import Line, checks
from program import ROOT, Work

# Each group registers its checks when it is imported.
import bodies  # noqa: F401
import coupled  # noqa: F401
import dam_break  # noqa: F401
import flow  # noqa: F401
import moving  # noqa: F401
import scale  # noqa: F401
import solver  # noqa: F401
import structures  # noqa: F401
import surface  # noqa: F401

COLUMNS = ("case", "quantity", "reference", "measured", "tolerance", "verdict", "source")


def main():
    parser = argparse.ArgumentParser(prog="scripts/validate", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="checks to run (all)")
    parser.add_argument("--quick", action="store_true", help="coarser and shorter, where a check has it")
    parser.add_argument("--ranks", type=int, default=2, metavar="N", help="ranks of each run (2)")
    parser.add_argument("--list", action="store_true", help="name the checks and run none")
    arguments = parser.parse_args()
    known = checks()
    if arguments.list:
        for check in known.values():
            print(f"{check.name:24} {check.about}")
        return 0
    for name in arguments.names:
        if name not in known:
            parser.error(f"no check is called {name}; there are {', '.join(known)}")
    lines = []
    for name in arguments.names or known:
        print(f"── {name}: {known[name].about}", flush=True)
        work = Work(name, quick=arguments.quick, ranks=arguments.ranks)
        for line in run(known[name], work):
            print("   " + "  ".join(line.cells()), flush=True)
            lines.append(line)
    print()
    print(table(lines))
    path = ROOT / "target/validation.json"
    path.write_text(json.dumps([line.as_dict() for line in lines], indent=1, ensure_ascii=False) + "\n")
    failed = sum(not line.passed for line in lines)
    print(f"\n{len(lines) - failed} of {len(lines)} lines pass; {path.relative_to(ROOT)}")
    return 1 if failed or not lines else 0


def run(check, work):
    """The check's lines; one that breaks down is a line that fails."""
    try:
        yield from check.run(work)
    except Exception as error:
        traceback.print_exc()
        yield Line(check.name, "runs to its end", "yes", str(error).strip().splitlines()[-1], "", "", False)


def table(lines):
    rows = [COLUMNS] + [line.cells() for line in lines]
    widths = [max(len(row[k]) for row in rows) for k in range(len(COLUMNS))]
    rows.insert(1, tuple("─" * width for width in widths))
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows)


sys.exit(main())
