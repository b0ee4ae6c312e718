"""A flight that a browser shows and commands (`page`), and the exercise of a class (`challenge`)."""
