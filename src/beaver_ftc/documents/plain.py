"""A document as JSON has it: what is written, or was read; within the program there are types."""

from typing import Any

Document = dict[str, Any]
