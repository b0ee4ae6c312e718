"""Documentation that its commands print.

python -m tools.docs [PAGE ...]    write every cheap block, number and picture again
python -m tools.docs --check       print what stands otherwise and every wrong name; status 1 if any
python -m tools.docs table NAME    print a table; `constants` prints those
python -m tools.docs cells PAGE    print the tables of a page as JSON, for numbers in the prose beside them
python -m tools.docs screens       take the pictures of report and live page again, with a browser
python -m tools.docs reference NAME    print a page of the generated reference, as the web site has it
"""

import argparse
import json
import signal
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module

from beaver_ftc.documents.errors import BeaverFtcError

PRINTERS = {  # the first argument: what prints
    "table": "tables:table",
    "cells": "cells:of_page",
    "constants": "constants:constants",
    "reference": "reference:page",
    "screens": "screens:screens",
}


def main() -> int:
    """Exit status 0 if nothing is wrong."""
    first = sys.argv[1] if len(sys.argv) > 1 else ""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        if first in PRINTERS:
            module, _, name = PRINTERS[first].partition(":")
            said = getattr(import_module(f"tools.docs.{module}"), name)(*sys.argv[2:])
            print(said if isinstance(said, str) else json.dumps(said, indent=1))
            return 0
        return _pages(_options())
    except BeaverFtcError as error:
        print(error, file=sys.stderr)
        return error.exit_code


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tools.docs", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pages", nargs="*", metavar="PAGE", help="detection, detection.md; all without any")
    parser.add_argument("--check", action="store_true", help="write nothing, print what differs")
    parser.add_argument("--dear", action="store_true", help="fly what takes long as well")
    parser.add_argument("--only", default="", metavar="TEXT", help="of what takes long, commands with this")
    parser.add_argument("--again", action="store_true", help="run also commands whose output is kept")
    parser.add_argument("--times", action="store_true", help="print which commands take longest")
    return parser.parse_args()


def _pages(options: argparse.Namespace) -> int:
    """Check the pages, or write what has changed; 1 if anything is wrong."""
    from tools.docs import names, prose
    from tools.docs.marks import read
    from tools.docs.pages import chosen
    from tools.docs.refresh import Wanted, refreshed, slowest, write

    pages = [read(path) for path in chosen(options.pages)]
    if options.check:
        with ThreadPoolExecutor(1) as beside:  # the last command leaves other cores idle
            words = beside.submit(lambda: names.check(pages, every=not options.pages) + prose.check(pages))
            made, printed = refreshed(pages, Wanted(probes=True, again=options.again))
            found = [finding for page in made for finding in (*page.findings, *page.changes)] + words.result()
    else:
        made, _ = refreshed(pages, Wanted(dear=options.dear, only=options.only, again=options.again))
        print("".join(f"{name}: written\n" for page in made for name in write(page)), end="")
        found = [finding for page in made for finding in page.findings]
    wrong = sum(not finding.said for finding in found)
    for finding in found:
        print(f"{finding}{' (only said)' if finding.said else ''}")
    if options.check:
        blocks, numbers = (sum(len(getattr(page, of)) for page in pages) for of in ("blocks", "numbers"))
        print(
            f"{len(pages)} pages, {blocks} blocks, {numbers} numbers, {len(printed)} commands: {wrong} wrong"
        )
        if options.times:
            print("\n".join(slowest(printed, 20)))
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
