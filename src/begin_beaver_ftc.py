"""Where the installed command begins: from here on Ctrl-C ends it without a traceback.

A file outside of the package, because an import of any part of `beaver_ftc` first imports what all of its
parts need: 0.1 s on an idle machine, and seconds on a busy one.
"""


def main() -> None:
    """Import the command line and run it."""
    try:
        from beaver_ftc.cli.begin import main as run
    except KeyboardInterrupt:
        raise SystemExit(130) from None  # 128 + SIGINT
    run()
