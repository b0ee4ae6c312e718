"""What commands the surfaces: laws, allocation, accommodation of a fault, the supervisor, rivals."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.control.base import Reference
else:
    __getattr__, __dir__ = lazily(__name__)
