"""What builds the documentation and checks data; not shipped in the wheel."""
